"""The scripting language of tree files: a small parser and interpreter, bounded, no `eval`."""
