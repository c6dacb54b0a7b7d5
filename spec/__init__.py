"""Tools that keep the specification of the `.pxi` format and the code in step."""
