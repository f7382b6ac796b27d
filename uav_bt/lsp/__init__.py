"""The language server of tree files: what an editor shows while a mission is being written."""
