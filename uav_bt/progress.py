"""Progress reports of long work."""

from __future__ import annotations

from collections.abc import Callable

Advance = Callable[[str, int, int], None]
"""Called with the stage's name, the steps done and the total number of steps."""


def silent(_stage: str, _done: int, _total: int) -> None:
    """Report nothing."""
