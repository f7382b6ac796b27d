"""Which scenes teach, which choose and which are reported on."""

from __future__ import annotations

from typing import Final

TRAINING_SCENES: Final = ("train-a", "train-b", "train-c", "train-d")
VALIDATION_SCENES: Final = ("val-a", "val-b")  # to choose and tune on
TESTING_SCENES: Final = ("test-a", "test-b")  # to report on, never to choose by
