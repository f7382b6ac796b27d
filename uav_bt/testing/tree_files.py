"""Recognises tree files among the XML files of a test folder."""

from __future__ import annotations

from pathlib import Path
from typing import Final

# A long comment may come before the root element with its format; chosen.
_HEAD_BYTES: Final = 20_000
_MARK: Final = b"BTCPP_format"


def is_tree_file(path: Path) -> bool:
    """Return whether an XML file is marked as a tree file; a damaged file counts too."""
    with path.open("rb") as file:
        return _MARK in file.read(_HEAD_BYTES)
