"""Tools that keep the specification of the `.pxi` format consistent with the code."""
