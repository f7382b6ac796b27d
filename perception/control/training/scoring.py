"""Scores of a control student against the rule, by window. This module does not import torch."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.control.runtime import ControlEstimate
from perception.control.training.samples import Batch, ControlSamples

_AT_ONCE: Final = 32  # windows

Predict = Callable[[Batch], Sequence[ControlEstimate]]
"""Returns the network's estimate for each window."""


@dataclass(frozen=True, kw_only=True)
class ControlScore:
    """Agreement with the rule; shares are of the windows that they apply to."""

    windows: int
    missed: float  # share of paths blocked for the rule where the student advances
    stopped: float  # share of paths free for the rule where the student turns
    wrong_side: float  # share of beginning turns to the wrong side
    step_error_m: float  # mean absolute error of the step, where both advance
    step_excess_m: float  # mean excess of the step, where both advance
    wrong_end: float  # share of views with a wrong end of the ground
    free_error_m: float  # mean absolute error of the free path
    movement_mse: float  # the paper's mean squared error of forward metres and yaw radians

    def to_json(self) -> dict[str, float | None]:
        """Return the score as plain JSON values; None for measures without windows."""
        return {name: value if np.isfinite(value) else None for name, value in asdict(self).items()}


def score_control(
    predict: Predict, samples: ControlSamples, *, max_windows: int = 2000
) -> ControlScore:
    """Score a network on windows without augmentation, evenly spread over all.

    Args:
        predict: the network.
        samples: the windows.
        max_windows: largest number of scored windows.
    """
    rows = [row for batch in _batches(samples, max_windows) for row in _rows(predict, batch)]
    values = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    free, goes = values["forward_m"] > 0.0, values["advance"] > 0.5
    begins, both = ~free & (values["turning"] == 0.0), free & goes
    excess = values["step_m"] - values["forward_m"]
    yaw_rad = np.where(goes, 0.0, np.where(values["clockwise"] > 0.5, 1.0, -1.0) * np.pi / 6.0)
    step_m = np.where(goes, values["step_m"], 0.0)
    squared = (step_m - values["forward_m"]) ** 2 + (yaw_rad - values["yaw_rad"]) ** 2
    return ControlScore(
        windows=len(rows),
        missed=_mean(goes, ~free),
        stopped=_mean(~goes, free),
        wrong_side=_mean((values["clockwise"] > 0.5) != (values["yaw_rad"] > 0.0), begins),
        step_error_m=_mean(np.abs(excess), both),
        step_excess_m=_mean(np.maximum(excess, 0.0), both),
        wrong_end=_mean((values["ground_ends"] > 0.5) != (values["ends"] > 0.5)),
        free_error_m=_mean(
            np.abs(values["estimated_free_m"] - values["free_m"]), np.isfinite(values["free_m"])
        ),
        movement_mse=_mean(squared) / 2.0,
    )


def _batches(samples: ControlSamples, max_windows: int) -> Iterator[Batch]:
    chosen = np.unique(np.linspace(0, len(samples) - 1, min(max_windows, len(samples))).astype(int))
    for first in range(0, len(chosen), _AT_ONCE):
        yield samples.window([int(at) for at in chosen[first : first + _AT_ONCE]])


def _rows(predict: Predict, batch: Batch) -> Iterator[dict[str, float]]:
    for estimate, label, turning in zip(predict(batch), batch.labels, batch.turning, strict=True):
        yield {
            "advance": estimate.advance,
            "clockwise": estimate.clockwise,
            "step_m": estimate.step_m,
            "ground_ends": estimate.ground_ends,
            "estimated_free_m": estimate.free_m,
            **dict(zip(("forward_m", "yaw_rad", "ends", "free_m"), map(float, label), strict=True)),
            "turning": float(turning),
        }


def _mean(values: NDArray[Any], counts: NDArray[np.bool_] | None = None) -> float:
    """Return the mean of the counted values; NaN without any."""
    chosen = values if counts is None else values[counts]
    return float(np.mean(chosen)) if len(chosen) else float("nan")
