"""Flying a tree: the board, the arbiter and the runner."""
