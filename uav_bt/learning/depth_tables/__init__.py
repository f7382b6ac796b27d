"""How good metric depth is: the paper's tables, measured on images of the twin."""
