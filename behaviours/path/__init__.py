"""Path planning over what is remembered."""
