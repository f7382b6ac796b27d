"""Which scenes teach, which choose and which are reported on; how a training tells of itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

__all__ = ["TESTING_SCENES", "TRAINING_SCENES", "VALIDATION_SCENES", "Advance", "silent"]

TRAINING_SCENES: Final = ("train-a", "train-b", "train-c", "train-d")
VALIDATION_SCENES: Final = ("val-a", "val-b")  # to choose and tune on
TESTING_SCENES: Final = ("test-a", "test-b")  # to report on, never to choose by

Advance = Callable[[str, int, int], None]
"""Told what is going on: the stage's name, steps done, steps in all."""


def silent(_stage: str, _done: int, _total: int) -> None:
    """Tell nobody."""
