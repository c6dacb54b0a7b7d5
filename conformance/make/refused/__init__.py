"""Files that must be refused; the cases of a module are in ``cases/refused-MODULE``."""
