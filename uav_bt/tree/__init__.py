"""The tree language: nodes, ports, registry and the loader of tree files."""
