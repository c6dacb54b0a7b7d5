"""Files that must be refused; the cases of a module lie in ``cases/refused-MODULE``."""
