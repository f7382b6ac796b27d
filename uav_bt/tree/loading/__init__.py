"""From a tree file to nodes: read, outlined, checked as a whole, and only then built."""
