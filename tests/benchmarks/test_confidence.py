"""The fit of the confidence of a scale, and its table."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from benchmarks.confidence import JudgedScale, fitted, table
from perception.depth.confidence import COEFFICIENTS


def judged(count: int = 400) -> list[JudgedScale]:
    """Return scales that are right where `slope` is high; the other measures are noise."""
    rng = np.random.default_rng(0)
    found = []
    for _ in range(count):
        measures = dict(zip(COEFFICIENTS, rng.random(len(COEFFICIENTS)).tolist(), strict=True))
        right = rng.random() < 1.0 / (1.0 + math.exp(-12.0 * (measures["slope"] - 0.5)))
        found.append(JudgedScale("paper, own network", right, measures["slope"], measures))
    return found


def in_the_middle(of: dict[str, float]) -> float:
    """Return the logit where each measure is a half."""
    return of["intercept"] + 0.5 * sum(of[name] for name in COEFFICIENTS)


def test_the_fit_finds_the_measure_that_tells() -> None:
    found = fitted(judged(), wrong_weight=1.0)
    assert list(found) == ["intercept", *COEFFICIENTS]
    others = [found[name] for name in COEFFICIENTS if name != "slope"]
    assert found["slope"] > 3.0 * max(others)
    assert min(others) >= 0.0
    assert in_the_middle(found) == pytest.approx(0.0, abs=0.5)
    strict = fitted(judged(), wrong_weight=10.0)
    assert in_the_middle(strict) < in_the_middle(found) - 1.0


def test_the_table_counts_by_condition_and_over_a_half() -> None:
    scales = judged()
    counts = Counter((each.right, each.confidence > 0.5) for each in scales)
    lines = dict(line.split(": ", 1) for line in table(scales).splitlines())
    assert (
        lines["paper, own network"]
        == lines["all"]
        == (
            f"{counts[True, True]} right scales trusted, {counts[True, False]} doubted; "
            f"{counts[False, True]} wrong, {counts[False, False]}"
        )
    )
