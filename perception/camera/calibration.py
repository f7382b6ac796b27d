"""Camera calibration from photographs of a checkerboard of unknown layout.

As in the paper, every corner layout in the photographs is tried, and the layout with the lowest
reprojection error is kept. The error on a layout's own corners says little, because even a wrong
camera fits a layout of few corners. So each camera is measured on all corners found in all
photographs, with only the board's pose fitted again. The layout with the lowest error there wins;
among layouts within 2 percent of it, the one with the most corners. A camera that the photographs
do not determine, or that no real lens matches, is refused. All limits are chosen.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from perception.camera.checkerboards import MIN_CORNERS, Corners, Photographs, find_boards, shows
from uav_bt.errors import InputError
from uav_bt.protocols import Advance, silent
from uav_bt.types import CameraModel
from uav_bt.types.arrays import Floats, Floats32

_MIN_IMAGES: Final = 3  # photographs per layout; fewer do not determine the focal length
_MAX_IMAGES: Final = 80  # photographs per layout for the solver; more take minutes, gain nothing
_MAX_LAYOUTS: Final = 12  # layouts tried: those with the most corners in total
_STRAY_FACTOR: Final = 3.0  # a photograph with this many times the median error is left out
_STRAY_FLOOR_PX: Final = 0.5  # a photograph with an error below this is never left out
_TIE: Final = 0.02  # relative difference below which errors count as equal; more corners win
_COPY_PX: Final = 2.0  # photographs with all corners closer than this are copies
# Deviation by focal length, warned above: 1.5 px of 720 (three test photographs: 1.2).
_DOUBTFUL: Final = 0.002
_SAMPLES: Final = 64  # radii at which the distortion is checked


@dataclass(frozen=True)
class LayoutTrial:
    """The camera from one corner layout, and its errors."""

    columns: int  # inner corners along the longer side
    rows: int  # inner corners along the shorter side
    images: tuple[str, ...]  # names of the photographs used
    error_px: float  # root mean square reprojection error of this layout's corners
    common_error_px: float  # root mean square error of all corners found in all photographs
    camera: CameraModel
    deviation_px: float  # largest standard deviation of fx, fy, cx and cy

    @property
    def corners(self) -> int:
        """Number of corners in all its photographs."""
        return self.columns * self.rows * len(self.images)


@dataclass(frozen=True)
class Calibration:
    """The result of a calibration, with all trials."""

    best: LayoutTrial
    trials: tuple[LayoutTrial, ...]  # by falling number of corners
    skipped: Mapping[str, str]  # photograph -> why the best layout did not use it
    warnings: tuple[str, ...]  # weak points, each with the photographs to add


def calibrate(
    photographs: Photographs, *, square_m: float = 0.02, advance: Advance = silent
) -> Calibration:
    """Find the camera's intrinsics; InputError if too few photographs show a board, or none fits.

    Photographs of another size than most are left out. A square's edge never changes the camera.
    """
    found, size_px, skipped = find_boards(photographs, advance)
    boards = _distinct(found, skipped)
    counted = {}
    for rows, columns in {grid.shape[:2] for grid in boards.values()}:
        images = sum(shows(grid, columns, rows) for grid in boards.values())
        if images >= _MIN_IMAGES:
            counted[columns, rows] = columns * rows * images
    layouts = sorted(counted, key=lambda layout: -counted[layout])[:_MAX_LAYOUTS]
    if not layouts:
        copies = len(found) - len(boards)
        raise InputError(
            f"a calibration needs at least {_MIN_IMAGES} photographs that show a "
            f"checkerboard of {MIN_CORNERS} inner corners or more, got {len(boards)} of "
            f"{len(photographs)}{f' ({copies} are copies of others)' if copies else ''}; take "
            "more, in good light, from different sides, with the whole board in view"
        )
    trials = list[LayoutTrial]()
    for done, (columns, rows) in enumerate(layouts, start=1):
        trials += _trials(boards, columns, rows, size_px, square_m)
        advance(f"layouts, {columns}x{rows}", done, len(layouts))
    trials.sort(key=lambda trial: -trial.corners)
    believed = [trial for trial in trials if not fault(trial)]
    if not believed:
        reason = "no layout of the boards gives a possible one"
        if trials:
            near = min(trials, key=lambda trial: trial.common_error_px)
            reason = f"the best layout, {near.columns}x{near.rows} corners, has {fault(near)}"
        raise InputError(
            f"no camera explains the photographs; {reason}. Photograph a flat checkerboard of "
            "plain black and white squares (no circles, ChArUco or AprilTags) with one zoom, "
            "sharp and not cropped, tilted by 30 degrees or more in several directions, and also "
            "near the image's edges and corners"
        )
    lowest = min(trial.common_error_px for trial in believed)
    tied = [trial for trial in believed if trial.common_error_px <= lowest * (1.0 + _TIE)]
    best = max(tied, key=lambda trial: trial.corners)
    reasons = {
        name: skipped.get(name) or _reason(boards.get(name), best, len(boards))
        for name in photographs
        if name not in best.images
    }
    warnings = doubts(best, [boards[name] for name in best.images])
    return Calibration(best, tuple(trials), reasons, warnings)


def _distinct(boards: Mapping[str, Corners], skipped: dict[str, str]) -> dict[str, Corners]:
    """Return the boards without copies, and add a line for each copy to `skipped`."""
    kept: dict[str, Corners] = {}
    for name, grid in boards.items():
        for other, seen in kept.items():
            if seen.shape == grid.shape and float(np.abs(seen - grid).max()) < _COPY_PX:
                skipped[name] = f"shows the board where {other} does: it adds nothing"
                break
        else:
            kept[name] = grid
    return kept


def _reason(grid: Corners | None, best: LayoutTrial, boards: int) -> str:
    """Return why the best layout did not use a photograph with this board."""
    if grid is None:
        return "no board found"
    if not shows(grid, best.columns, best.rows):
        return (
            f"only {grid.shape[1]}x{grid.shape[0]} of {best.columns}x{best.rows} corners found: "
            "the board is partly out of view, or too small"
        )
    return f"{_MAX_IMAGES} others are enough" if boards > _MAX_IMAGES else "does not fit the others"


# --- solving --------------------------------------------------------------------------------------


def _trials(
    boards: Mapping[str, Corners],
    columns: int,
    rows: int,
    size_px: tuple[int, int],
    square_m: float,
) -> Iterator[LayoutTrial]:
    """Yield the camera from one layout, if any; larger boards contribute a part of this layout."""
    names = [name for name, grid in boards.items() if shows(grid, columns, rows)]
    if len(names) > _MAX_IMAGES:  # at even intervals, because adjacent video frames are alike
        places = np.linspace(0, len(names) - 1, _MAX_IMAGES).round().astype(int)
        names = [names[place] for place in places]
    points = _points(columns, rows, square_m)

    def solve(used: list[str]) -> tuple[float, CameraModel | None, float, Floats]:
        """Return the error, the camera, its largest deviation and the error of each view, px."""
        error_px, matrix, distortion, _, _, deviations, _, per_view = cv2.calibrateCameraExtended(
            [points] * len(used),
            [boards[name][:rows, :columns].reshape(-1, 1, 2) for name in used],
            size_px,
            np.eye(3),
            np.zeros(5),
            # A third radial term would bend the image's corners, which boards seldom reach.
            flags=cv2.CALIB_FIX_K3,
        )
        camera = _camera(np.asarray(matrix, np.float64), np.ravel(distortion), size_px)
        deviation_px = float(np.max(np.ravel(deviations)[:4]))  # of fx, fy, cx, cy
        return float(error_px), camera, deviation_px, np.asarray(per_view, np.float64).ravel()

    error_px, camera, deviation_px, views_px = solve(names)
    limit_px = max(_STRAY_FLOOR_PX, _STRAY_FACTOR * float(np.median(views_px)))
    kept = [name for name, view_px in zip(names, views_px, strict=True) if view_px <= limit_px]
    if _MIN_IMAGES <= len(kept) < len(names):
        error_px, camera, deviation_px, _ = solve(kept)
    if len(kept) >= _MIN_IMAGES and camera is not None:
        common_px = _common_error(boards, camera, square_m)
        yield LayoutTrial(columns, rows, tuple(kept), error_px, common_px, camera, deviation_px)


def _points(columns: int, rows: int, square_m: float) -> Floats32:
    down, along = np.mgrid[:rows, :columns].astype(np.float32)
    flat = np.stack([along, down, np.zeros_like(along)], axis=-1).reshape(-1, 3)
    return np.asarray(flat * np.float32(square_m))


def _camera(matrix: Floats, distortion: Floats, size_px: tuple[int, int]) -> CameraModel | None:
    """Return the solver's camera; None for one that is impossible for a lens."""
    (fx, _, cx), (_, fy, cy), _ = matrix.tolist()
    finite = np.isfinite(matrix).all() and np.isfinite(distortion).all()
    width, height = size_px
    inside = 0.0 < cx < width and 0.0 < cy < height
    if not finite or not inside or not 0.2 < fx / max(size_px) < 20.0:
        return None
    bent = tuple(distortion.tolist())
    return CameraModel(
        width_px=width, height_px=height, fx_px=fx, fy_px=fy, cx_px=cx, cy_px=cy, distortion=bent
    )


def _common_error(boards: Mapping[str, Corners], camera: CameraModel, square_m: float) -> float:
    """Return the root mean square error over all corners, without stray photographs."""
    matrix, distortion = camera.matrix, np.array(camera.distortion)
    errors, weights = [], []
    for grid in boards.values():
        rows, columns = grid.shape[:2]
        points, seen = _points(columns, rows, square_m), grid.reshape(-1, 1, 2)
        solved, turn, place = cv2.solvePnP(points, seen, matrix, distortion)
        if not solved:
            continue
        drawn, _ = cv2.projectPoints(points, turn, place, matrix, distortion)
        errors.append(float(np.mean(np.sum((drawn - seen) ** 2, axis=-1))))
        weights.append(rows * columns)
    squared = np.array(errors)
    limit = max(_STRAY_FLOOR_PX, _STRAY_FACTOR * math.sqrt(np.median(squared))) ** 2
    kept = squared <= limit
    return math.sqrt(float(np.average(squared[kept], weights=np.array(weights)[kept])))


# --- checks ---------------------------------------------------------------------------------------


def fault(trial: LayoutTrial) -> str:
    """Return why a camera is refused, although its corners may fit; empty when it is accepted."""
    camera = trial.camera
    fx_px, fy_px, cx_px, cy_px = camera.pinhole_px
    places = (cx_px + 0.5) / camera.width_px, (cy_px + 0.5) / camera.height_px
    off = max(abs(place - 0.5) for place in places)
    bent = " ".join(f"{value:.3g}" for value in camera.distortion)
    known_px = trial.deviation_px
    limits = (  # what, its value, and the largest that is accepted; NaN is refused, too
        ("reprojection error, px", trial.error_px, 1.0),  # good calibrations: below 0.3 (the tests)
        # Cameras have square pixels, and lenses are above the middle of the sensor.
        (f"difference of the focal lengths {fx_px:.0f}, {fy_px:.0f} px", fx_px / fy_px - 1.0, 0.05),
        (f"offset of the centre ({cx_px:.0f}, {cy_px:.0f}) by the image's size", off, 0.2),
        (f"stretch of a radius by the distortion {bent}", _stretch(camera), 2.0),  # fisheye: less
        (f"deviation, {known_px:.1f} px, by focal length", known_px / min(fx_px, fy_px), 0.01),
    )
    return "; ".join(
        f"{what}: {value:.3g}, at most {limit:g}"
        for what, value, limit in limits
        if not abs(value) <= limit
    )


def _stretch(camera: CameraModel) -> float:
    """Return the largest factor of a radius by the distortion; inf where the image folds."""
    k1, k2 = (*camera.distortion, 0.0, 0.0)[:2]
    fx, fy, cx, cy = camera.pinhole_px
    across, down = max(cx, camera.width_px - cx) / fx, max(cy, camera.height_px - cy) / fy
    farthest = math.hypot(across, down)
    squared = np.linspace(0.0, farthest, _SAMPLES) ** 2
    stretch = 1.0 + k1 * squared + k2 * squared**2
    slope = 1.0 + 3.0 * k1 * squared + 5.0 * k2 * squared**2
    if min(slope.min(), stretch.min()) <= 0.0:
        return math.inf
    return float(max(stretch.max(), 1.0 / stretch.min()))


def doubts(trial: LayoutTrial, boards: list[Corners]) -> tuple[str, ...]:
    """Return sentences about the weak points of a camera from some boards."""
    camera, found = trial.camera, list[str]()
    wanted_px = _DOUBTFUL * min(camera.fx_px, camera.fy_px)
    if trial.deviation_px > wanted_px:
        found.append(
            f"focal lengths and centre are known to {trial.deviation_px:.1f} px (standard "
            f"deviation), {wanted_px:.1f} px is good; add photographs of the tilted board"
        )
    places = np.concatenate([grid.reshape(-1, 2) for grid in boards])
    parts = np.clip((places / (camera.width_px, camera.height_px) * 3).astype(int), 0, 2)
    seen = len(np.unique(parts, axis=0))
    if seen < 9:
        found.append(
            f"corners were seen in {seen} of the image's 9 parts (3x3); photograph the board also "
            "in the others"
        )
    return tuple(found)
