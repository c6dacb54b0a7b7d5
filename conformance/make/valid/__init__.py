"""Valid files; the cases of a module are in ``cases/MODULE``."""
