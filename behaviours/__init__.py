"""py_trees leaves of the missions, and the policies behind them."""
