"""Which XML files are tree files."""

from __future__ import annotations

from pathlib import Path
from typing import Final

# The root element with its format stands at the beginning; a long comment may come before.
_HEAD_BYTES: Final = 20_000
_MARK: Final = b"BTCPP_format"


def is_tree_file(path: Path) -> bool:
    """Return whether an XML file is marked as a tree file, be it damaged."""
    with path.open("rb") as file:
        return _MARK in file.read(_HEAD_BYTES)
