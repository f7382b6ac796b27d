"""Fit the confidence of the scale of depth, and compare it with the scale's error.

    python -m benchmarks.confidence fit --rooms runs/rooms/val     # coefficients, training scenes
    python -m benchmarks.confidence val --rooms runs/rooms/val2    # the table, validation scenes
    python -m benchmarks.confidence test --rooms runs/rooms/flown  # testing scenes

The confidence is to be above a half only where nearly all scales are right.
"""

from __future__ import annotations

import argparse
import math
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from benchmarks.confidence_views import RIGHT, JudgedScale, judged_scales

WRONG_WEIGHT = 20.0  # right scales that a wrong one counts as; chosen on the validation scenes
_PENALTY = 1e-4  # of the squared coefficients


def fitted(judged: Sequence[JudgedScale], wrong_weight: float = WRONG_WEIGHT) -> dict[str, float]:
    """Return the intercept and the coefficients, none negative, of a logistic regression."""
    own = [each for each in judged if each.measures]
    names = list(own[0].measures)
    values = np.array([[each.measures[name] for name in names] for each in own])
    right = np.array([each.right for each in own], dtype=float)
    weights = np.where(right > 0.0, 1.0, wrong_weight)
    weights /= weights.sum()

    def loss(given: np.ndarray) -> tuple[float, np.ndarray]:
        logits = given[0] + values @ given[1:]
        costs = np.logaddexp(0.0, -logits) * right + np.logaddexp(0.0, logits) * (1.0 - right)
        off = weights * (1.0 / (1.0 + np.exp(-logits)) - right)
        slope = np.concatenate([[off.sum()], values.T @ off + 2.0 * _PENALTY * given[1:]])
        return float(weights @ costs + _PENALTY * (given[1:] ** 2).sum()), slope

    count = len(names)
    limits = [(None, None), *[(0.0, None)] * count]
    found = minimize(loss, np.r_[0.0, np.ones(count)], jac=True, bounds=limits, method="L-BFGS-B")
    return dict(zip(("intercept", *names), found.x.tolist(), strict=True))


def table(judged: Sequence[JudgedScale]) -> str:
    """Return shares of the scales by confidence, by lab and condition, and by lab."""
    parts: dict[str, list[JudgedScale]] = defaultdict(list)
    for tenth in range(10):
        parts[f"{tenth / 10:.1f} to {(tenth + 1) / 10:.1f}"] = []
    for each in judged:
        tenth = min(9, int(10.0 * each.confidence))
        parts[f"{tenth / 10:.1f} to {(tenth + 1) / 10:.1f}"].append(each)
        parts[f"{each.lab}, {each.condition}"].append(each)
        if each.condition in RIGHT:
            parts[f"{each.lab}, its own network"].append(each)
        parts["all"].append(each)
    return "\n".join(f"{name}: {_row(part)}" for name, part in parts.items())


def _row(part: Sequence[JudgedScale]) -> str:
    if not part:
        return "0 scales"
    right = [each for each in part if each.right]
    worst = math.exp(max(abs(math.log(each.over_exact)) for each in part))
    sure = sum(each.confidence > 0.5 for each in right)
    wrong = sum(each.confidence > 0.5 for each in part if not each.right)
    return (
        f"{len(part)} scales, {len(right)} right, worst factor {worst:.2f}; "
        f"over 0.5: {sure} of the right, {wrong} wrong"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Print coefficients or the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("what", choices=("fit", "train", "val", "test"))
    parser.add_argument("--views", type=int, default=40, help="poses of a scene")
    parser.add_argument("--seed", type=int, default=31)
    parser.add_argument("--rooms", type=Path, help="folder of generated rooms")
    given = parser.parse_args(arguments)
    split = "train" if given.what == "fit" else given.what
    judged = list(judged_scales(split, given.views, given.seed, rooms=given.rooms))
    if given.what == "fit":
        for part in (False, True):  # without and with depth in heights
            chosen = [each for each in judged if ("height" in each.measures) is part]
            for name, value in fitted(chosen).items():
                print(f"{name}: {value:.2f}")
    else:
        print(table(judged))


if __name__ == "__main__":
    main()
