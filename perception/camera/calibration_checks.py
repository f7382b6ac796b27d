"""Checks that find a wrong calibration although its reprojection error is low.

A low error shows that some camera fits the corners, not that the corners determine it. Copies of
one photograph add no information. Standard deviations and the part of the image with corners show
how well the camera is determined.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from perception.camera.checkerboards import Corners
from uav_bt.types import CameraModel

_PARTS: Final = (  # of the image, in a grid of 3x3
    *("upper left", "top", "upper right"),
    *("left", "centre", "right"),
    *("lower left", "bottom", "lower right"),
)
_SAMPLES: Final = 64  # radii at which the distortion is checked; chosen


@dataclass(frozen=True, kw_only=True)
class CalibrationLimits:
    """Limits for accepting a camera. All numbers are chosen."""

    error_px: float = 1.0  # root mean square; good calibrations are below 0.3 (the tests)
    aspect: float = 0.05  # difference of fx / fy from 1, because cameras have square pixels
    centre: float = 0.2  # offset from the middle by the image's size; lenses are above the sensor
    stretch: float = 2.0  # of a radius by the distortion, anywhere in the image (fisheye: below 2)
    deviation: float = 0.01  # standard deviation by focal length: refused above, 0.6 degrees
    doubtful: float = 0.002  # likewise: warned above, 1.5 px of 720 (three test photographs: 1.2)
    copy_px: float = 2.0  # photographs with all corners closer than this are copies


def distinct(
    boards: Mapping[str, Corners], limits: CalibrationLimits
) -> tuple[dict[str, Corners], dict[str, str]]:
    """Return the boards without copies, and a message for each copy."""
    kept: dict[str, Corners] = {}
    copies = {}
    for name, grid in boards.items():
        same = next(
            (
                other
                for other, seen in kept.items()
                if seen.shape == grid.shape and float(np.abs(seen - grid).max()) < limits.copy_px
            ),
            None,
        )
        if same is None:
            kept[name] = grid
        else:
            copies[name] = f"shows the board where {same} does: it adds nothing"
    return kept, copies


def fault(
    camera: CameraModel,
    error_px: float,
    deviations_px: tuple[float, ...],
    limits: CalibrationLimits,
) -> str:
    """Return why a camera is refused; empty when it is accepted.

    Args:
        camera: the result of the solver.
        error_px: root mean square reprojection error.
        deviations_px: (4,) standard deviations of fx, fy, cx, cy.
        limits: limits for accepting a camera.
    """
    if error_px > limits.error_px:
        return (
            f"the reprojection error is {error_px:.2f} px, at most {limits.error_px:g} px is "
            "accepted; only checkerboards of plain black and white squares are known (no circles, "
            "ChArUco or AprilTags), flat, taken with one zoom and without motion"
        )
    aspect = camera.fx_px / camera.fy_px
    if abs(aspect - 1.0) > limits.aspect:
        return (
            f"the focal lengths are {camera.fx_px:.0f} and {camera.fy_px:.0f} px, which must be "
            f"equal within {limits.aspect:.0%}; tilt the board in both directions"
        )
    middle = (camera.width_px - 1) / 2, (camera.height_px - 1) / 2
    off = (
        abs(camera.cx_px - middle[0]) / camera.width_px,
        abs(camera.cy_px - middle[1]) / camera.height_px,
    )
    if max(off) > limits.centre:
        return (
            f"the centre ({camera.cx_px:.0f}, {camera.cy_px:.0f}) is more than "
            f"{limits.centre:.0%} of the image beside its middle; photograph the board in all "
            "parts of the image, and do not crop the photographs"
        )
    if not _believable_distortion(camera, limits):
        return (
            f"the distortion {' '.join(f'{value:.3g}' for value in camera.distortion)} folds the "
            "image; photograph the board also near the image's edges and corners"
        )
    worst = float(np.max(deviations_px))
    allowed = limits.deviation * min(camera.fx_px, camera.fy_px)
    if not worst <= allowed:  # NaN too
        return (
            f"focal lengths and centre are known to {worst:.1f} px only (standard deviation), at "
            f"most {allowed:.1f} px is accepted; tilt the board by 30 degrees or more in several "
            "directions, and fill the image with it"
        )
    return ""


def _believable_distortion(camera: CameraModel, limits: CalibrationLimits) -> bool:
    """Return whether the distorted radius grows up to the farthest corner, within `stretch`."""
    k1, k2 = (*camera.distortion, 0.0, 0.0)[:2]
    farthest = math.hypot(
        max(camera.cx_px, camera.width_px - camera.cx_px) / camera.fx_px,
        max(camera.cy_px, camera.height_px - camera.cy_px) / camera.fy_px,
    )
    squared = np.linspace(0.0, farthest, _SAMPLES) ** 2
    stretch = 1.0 + k1 * squared + k2 * squared**2
    slope = 1.0 + 3.0 * k1 * squared + 5.0 * k2 * squared**2
    return bool(
        (slope > 0.0).all()
        and (stretch < limits.stretch).all()
        and (stretch > 1.0 / limits.stretch).all()
    )


def doubts(
    camera: CameraModel,
    deviations_px: tuple[float, ...],
    boards: Mapping[str, Corners],
    limits: CalibrationLimits,
) -> tuple[str, ...]:
    """Return sentences about weak points, each with its number and the photographs to add.

    Args:
        camera: the result of the solver.
        deviations_px: (4,) standard deviations of fx, fy, cx, cy.
        boards: corners of the photographs used.
        limits: limits for accepting a camera.
    """
    found = []
    worst = float(np.max(deviations_px))
    wanted = limits.doubtful * min(camera.fx_px, camera.fy_px)
    if worst > wanted:
        found.append(
            f"focal lengths and centre are known to {worst:.1f} px (standard deviation), "
            f"{wanted:.1f} px is good; add photographs of the tilted board"
        )
    places = np.concatenate([grid.reshape(-1, 2) for grid in boards.values()])
    size = np.array([camera.width_px, camera.height_px])
    columns, rows = np.clip((places / size * 3).astype(int), 0, 2).T
    empty = [part for index, part in enumerate(_PARTS) if not (3 * rows + columns == index).any()]
    if empty:
        found.append(
            f"corners were seen in {len(_PARTS) - len(empty)} of the image's {len(_PARTS)} parts; "
            f"photograph the board there: {', '.join(empty)}"
        )
    return tuple(found)
