"""The way to a place round what is remembered: planned on a grid, kept while it is as good."""
