"""Valid files; the cases of a module lie in ``cases/MODULE``."""
