"""The fit of the confidence of a scale, and its table."""

from __future__ import annotations

import math

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
        off = 1.1 if right else 2.0
        found.append(JudgedScale("paper", "own network", off, measures["slope"], measures))
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


def test_scales_of_earlier_frames_are_not_fitted() -> None:
    scales, carried = judged(), JudgedScale("paper", "own network", 3.0, 0.9, {})
    assert fitted([*scales, *[carried] * 50]) == fitted(scales)


def test_the_table_counts_by_tenths_and_over_a_half() -> None:
    scales = judged()
    lines = dict(line.split(": ", 1) for line in table(scales).splitlines())
    right = [each for each in scales if each.right]
    sure = sum(each.confidence > 0.5 for each in right)
    wrong = sum(each.confidence > 0.5 for each in scales if not each.right)
    assert lines["all"] == (
        f"400 scales, {len(right)} right, worst factor 2.00; "
        f"over 0.5: {sure} of the right, {wrong} wrong"
    )
    assert lines["paper, own network"] == lines["paper, its own network"] == lines["all"]
    top = sum(each.confidence >= 0.9 for each in scales)
    assert lines["0.9 to 1.0"].startswith(f"{top} scales, ")
