"""Calibrations that are refused or doubted although their reprojection error is low."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from perception.camera.calibration_checks import CalibrationLimits, distinct, doubts, fault
from uav_bt.types import CameraModel

LIMITS = CalibrationLimits()
GOOD = CameraModel(
    width_px=640,
    height_px=512,
    fx_px=520.0,
    fy_px=521.0,
    cx_px=322.0,
    cy_px=250.0,
    distortion=(-0.1, 0.02, 0.0, 0.0, 0.0),
)
SURE = (0.2, 0.2, 0.2, 0.2)


def board(left_px: float, top_px: float, spacing_px: float = 20.0) -> NDArray[np.float32]:
    """Return 4x3 corners, the first at a place."""
    down, along = np.mgrid[:3, :4]
    grid = np.stack([left_px + spacing_px * along, top_px + spacing_px * down], axis=-1)
    return grid.astype(np.float32)


def test_a_good_camera_is_believed() -> None:
    assert fault(GOOD, 0.1, SURE, LIMITS) == ""


@pytest.mark.parametrize(
    ("camera", "error_px", "deviations_px", "words"),
    [
        (GOOD, 16.99, SURE, "reprojection error is 16.99 px, at most 1 px"),
        (replace(GOOD, fx_px=195.7, fy_px=296.5), 0.2, SURE, "196 and 296 px, which must be equal"),
        (replace(GOOD, cx_px=60.0), 0.2, SURE, "centre (60, 250) is more than 20% of the image"),
        (
            replace(GOOD, distortion=(0.1, -161.0, 0.0, 0.0, 0.0)),
            0.2,
            SURE,
            "the distortion 0.1 -161 0 0 0 folds the image",
        ),
        (replace(GOOD, distortion=(3.0, 0.0)), 0.2, SURE, "folds the image"),
        (GOOD, 0.2, (32.0, 34.7, 7.6, 4.5), "known to 34.7 px only"),
        (GOOD, 0.2, (float("nan"),) * 4, "known to nan px only"),
    ],
)
def test_a_camera_that_no_lens_has_is_refused(
    camera: CameraModel, error_px: float, deviations_px: tuple[float, ...], words: str
) -> None:
    assert words in fault(camera, error_px, deviations_px, LIMITS)


def test_a_wide_lens_is_believed() -> None:
    """120 degrees wide, as of an action camera."""
    wide = replace(GOOD, fx_px=230.0, fy_px=230.0, distortion=(-0.25, 0.06, 0.0, 0.0, 0.0))
    assert fault(wide, 0.3, SURE, LIMITS) == ""


def test_copies_are_left_out_and_name_what_they_repeat() -> None:
    boards = {"a": board(100, 100), "b": board(101, 100.5), "c": board(103, 100)}
    kept, copies = distinct(boards, LIMITS)
    assert list(kept) == ["a", "c"]
    assert copies == {"b": "shows the board where a does: it adds nothing"}


def test_boards_in_the_middle_only_are_doubted_with_the_parts_to_photograph() -> None:
    (line,) = doubts(GOOD, SURE, {"a": board(290, 230)}, LIMITS)
    assert "seen in 1 of the image's 9 parts" in line
    assert line.endswith(
        "upper left, top, upper right, left, right, lower left, bottom, lower right"
    )


def test_boards_everywhere_are_not_doubted() -> None:
    everywhere = {"a": board(20, 20, 190.0), "b": board(20, 100, 190.0)}
    assert doubts(GOOD, SURE, everywhere, LIMITS) == ()
    (line,) = doubts(GOOD, (1.2, 1.0, 0.6, 1.1), everywhere, LIMITS)
    assert "known to 1.2 px (standard deviation), 1.0 px is good" in line
