"""How good metric depth is: the paper's tables, measured on pictures of the twin."""
