"""Furnished rooms by chance, from furniture and pictures of packages with a free licence."""
