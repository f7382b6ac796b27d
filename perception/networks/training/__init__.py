"""Shared training code of all networks: training loop, files and export. It imports torch."""
