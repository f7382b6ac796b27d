"""Camera calibration from photographs of a checkerboard of unknown layout.

As in the paper, every corner layout in the photographs is tried, and the layout with the lowest
reprojection error is kept. The error on a layout's own corners says little, because even a wrong
camera fits a layout of few corners. So each camera is measured on the same set: all corners found
in all photographs, with only the board's pose fitted again. The layout with the lowest error there
wins; among layouts within 2 percent of it, the one with the most corners wins. A camera that the
photographs do not determine, or that no real lens matches, is refused (`calibration_checks`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.calibration_checks import CalibrationLimits, distinct, doubts, fault
from perception.camera.checkerboards import MIN_CORNERS, Corners, Photographs, find_boards, shows
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.progress import Advance, silent
from uav_bt.types import CameraModel


@dataclass(frozen=True, kw_only=True)
class CalibrationConfig:
    """Which layouts are tried and which photographs and cameras are accepted."""

    square_m: float = 0.02  # edge of a square; changes distances, never the camera
    min_images: int = 3  # photographs per layout; fewer do not determine the focal length
    max_layouts: int = 12  # layouts tried: those with the most corners in total
    max_images: int = 80  # photographs per layout for the solver; more take minutes, gain nothing
    stray_factor: float = 3.0  # a photograph with this many times the median error is left out
    stray_floor_px: float = 0.5  # a photograph with an error below this is never left out
    tie: float = 0.02  # relative difference below which errors count as equal; more corners win
    limits: CalibrationLimits = field(default_factory=CalibrationLimits)

    def __post_init__(self) -> None:
        if not (math.isfinite(self.square_m) and self.square_m > 0.0):
            raise ValueRangeError(f"the square's edge must be positive, got {self.square_m} m")


@dataclass(frozen=True, kw_only=True)
class LayoutTrial:
    """The camera from one corner layout, and its errors."""

    columns: int  # inner corners along the longer side
    rows: int  # inner corners along the shorter side
    images: tuple[str, ...]  # names of the photographs used
    error_px: float  # root mean square reprojection error of this layout's corners
    common_error_px: float  # root mean square error of all corners found in all photographs
    camera: CameraModel
    deviations_px: tuple[float, ...] = ()  # standard deviations of fx, fy, cx, cy
    fault: str = ""  # why the camera is refused; empty when it is accepted

    @property
    def corners(self) -> int:
        """Number of corners in all its photographs."""
        return self.columns * self.rows * len(self.images)


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """The result of a calibration, with all trials."""

    best: LayoutTrial
    trials: tuple[LayoutTrial, ...]  # by falling number of corners
    skipped: Mapping[str, str]  # photograph -> why the best layout did not use it
    warnings: tuple[str, ...]  # weak points, each with the photographs to add


def calibrate(
    photographs: Photographs,
    config: CalibrationConfig | None = None,
    *,
    advance: Advance = silent,
) -> Calibration:
    """Find the camera's intrinsics.

    Args:
        photographs: by name, a function that returns the image, (H, W) uint8 grey. Photographs of
            another size than most are left out.
        config: which layouts are tried.
        advance: called with the progress.

    Raises:
        InputError: too few photographs show a board, or every resulting camera is refused.
    """
    config = config or CalibrationConfig()
    found, size_px, unusable = find_boards(photographs, advance)
    boards, copies = distinct(found, config.limits)
    unusable |= copies
    layouts = _layouts(boards, config)
    if not layouts:
        raise InputError(
            f"a calibration needs at least {config.min_images} photographs that show a "
            f"checkerboard of {MIN_CORNERS} inner corners or more, got {len(boards)} of "
            f"{len(photographs)}{f' ({len(copies)} are copies of others)' if copies else ''}; take "
            "more, in good light, from different sides, with the whole board in view"
        )
    trials = []
    for done, (columns, rows) in enumerate(layouts, start=1):
        trial = _try_layout(boards, columns, rows, size_px, config)
        if trial is not None:
            trials.append(trial)
        advance(f"layouts, {columns}x{rows}", done, len(layouts))
    if not trials:
        raise InputError(
            "no layout of the boards gives a plausible camera; photograph the board from several "
            "sides, tilted, not only from the front"
        )
    believed = [trial for trial in trials if not trial.fault]
    if not believed:
        nearest = min(trials, key=lambda trial: trial.common_error_px)
        raise InputError(
            f"no camera explains the photographs; the best layout is {nearest.columns}x"
            f"{nearest.rows} corners in {len(nearest.images)} of {len(photographs)} photographs, "
            f"and {nearest.fault}"
        )
    lowest = min(trial.common_error_px for trial in believed)
    near = [trial for trial in believed if trial.common_error_px <= lowest * (1.0 + config.tie)]
    best = max(near, key=lambda trial: trial.corners)
    trials.sort(key=lambda trial: -trial.corners)
    return Calibration(
        best=best,
        trials=tuple(trials),
        skipped=_skipped(photographs, boards, best, config) | unusable,
        warnings=doubts(
            best.camera,
            best.deviations_px,
            {name: boards[name] for name in best.images},
            config.limits,
        ),
    )


def _layouts(boards: Mapping[str, Corners], config: CalibrationConfig) -> list[tuple[int, int]]:
    """Return (columns, rows) of the layouts in enough photographs, by falling corners."""
    counted = {}
    for rows, columns in {grid.shape[:2] for grid in boards.values()}:
        images = sum(shows(grid, columns, rows) for grid in boards.values())
        if images >= config.min_images:
            counted[columns, rows] = columns * rows * images
    return sorted(counted, key=lambda layout: -counted[layout])[: config.max_layouts]


# --- solving --------------------------------------------------------------------------------------


def _try_layout(
    boards: Mapping[str, Corners],
    columns: int,
    rows: int,
    size_px: tuple[int, int],
    config: CalibrationConfig,
) -> LayoutTrial | None:
    """Solve for a camera from one layout; larger boards contribute a part of this layout."""
    views = {
        name: np.ascontiguousarray(grid[:rows, :columns])
        for name, grid in boards.items()
        if shows(grid, columns, rows)
    }
    names = _spread(list(views), config.max_images)
    solved = _solve([views[name] for name in names], size_px, config)
    limit_px = max(config.stray_floor_px, config.stray_factor * float(np.median(solved.views_px)))
    kept = [
        name for name, view_px in zip(names, solved.views_px, strict=True) if view_px <= limit_px
    ]
    if len(kept) < config.min_images:
        return None
    if len(kept) < len(names):
        solved = _solve([views[name] for name in kept], size_px, config)
    if solved.camera is None:
        return None
    return LayoutTrial(
        columns=columns,
        rows=rows,
        images=tuple(kept),
        error_px=solved.error_px,
        common_error_px=_common_error(boards, solved.camera, config),
        camera=solved.camera,
        deviations_px=solved.deviations_px,
        fault=fault(solved.camera, solved.error_px, solved.deviations_px, config.limits),
    )


def _spread(names: list[str], count: int) -> list[str]:
    """Return at most `count` names at even intervals, because adjacent video frames are alike."""
    if len(names) <= count:
        return names
    places = np.linspace(0, len(names) - 1, count).round().astype(int)
    return [names[place] for place in places]


def _points(grid: Corners, square_m: float) -> NDArray[np.float32]:
    rows, columns = grid.shape[:2]
    down, along = np.mgrid[:rows, :columns].astype(np.float32)
    flat = np.stack([along, down, np.zeros_like(along)], axis=-1).reshape(-1, 3)
    return np.asarray(flat * np.float32(square_m))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Solved:
    error_px: float  # root mean square
    camera: CameraModel | None  # None: impossible for a lens
    deviations_px: tuple[float, ...]  # standard deviations of fx, fy, cx, cy
    views_px: NDArray[np.float64]  # (N,) error of each view


def _solve(views: list[Corners], size_px: tuple[int, int], config: CalibrationConfig) -> _Solved:
    error, matrix, distortion, _, _, deviations, _, per_view = cv2.calibrateCameraExtended(
        [_points(grid, config.square_m) for grid in views],
        [grid.reshape(-1, 1, 2) for grid in views],
        size_px,
        np.eye(3),
        np.zeros(5),
        # A third radial term would bend the image's corners, which boards seldom reach.
        flags=cv2.CALIB_FIX_K3,
    )
    camera = _camera(np.asarray(matrix, np.float64), np.asarray(distortion, np.float64), size_px)
    return _Solved(
        error_px=float(error),
        camera=camera,
        deviations_px=tuple(float(value) for value in np.ravel(deviations)[:4]),
        views_px=np.asarray(per_view, np.float64).ravel(),
    )


def _camera(
    matrix: NDArray[np.float64], distortion: NDArray[np.float64], size_px: tuple[int, int]
) -> CameraModel | None:
    width_px, height_px = size_px
    (fx, _, cx), (_, fy, cy), _ = matrix
    numbers = np.concatenate([[fx, fy, cx, cy], distortion.ravel()])
    inside = 0.0 < cx < width_px and 0.0 < cy < height_px
    if not np.isfinite(numbers).all() or not inside or not 0.2 < fx / max(size_px) < 20.0:
        return None
    return CameraModel(
        width_px=width_px,
        height_px=height_px,
        fx_px=float(fx),
        fy_px=float(fy),
        cx_px=float(cx),
        cy_px=float(cy),
        distortion=tuple(float(value) for value in distortion.ravel()),
    )


def _common_error(
    boards: Mapping[str, Corners], camera: CameraModel, config: CalibrationConfig
) -> float:
    """Return the root mean square error over all corners, without stray photographs."""
    matrix = np.array(
        [[camera.fx_px, 0.0, camera.cx_px], [0.0, camera.fy_px, camera.cy_px], [0.0, 0.0, 1.0]]
    )
    distortion = np.array(camera.distortion)
    errors, weights = [], []
    for grid in boards.values():
        points, seen = _points(grid, config.square_m), grid.reshape(-1, 1, 2)
        solved, turn, place = cv2.solvePnP(points, seen, matrix, distortion)
        if not solved:
            continue
        drawn, _ = cv2.projectPoints(points, turn, place, matrix, distortion)
        errors.append(float(np.mean(np.sum((drawn - seen) ** 2, axis=-1))))
        weights.append(grid.shape[0] * grid.shape[1])
    squared = np.array(errors)
    limit = max(config.stray_floor_px, config.stray_factor * math.sqrt(np.median(squared))) ** 2
    kept = squared <= limit
    return math.sqrt(float(np.average(squared[kept], weights=np.array(weights)[kept])))


def _skipped(
    photographs: Photographs,
    boards: Mapping[str, Corners],
    best: LayoutTrial,
    config: CalibrationConfig,
) -> dict[str, str]:
    """Return the reason for each photograph that the best layout did not use."""
    whole = f"{best.columns}x{best.rows}"
    reasons = {}
    for name in photographs:
        if name in best.images:
            continue
        grid = boards.get(name)
        if grid is None:
            reasons[name] = "no board found"
        elif not shows(grid, best.columns, best.rows):
            reasons[name] = (
                f"only {grid.shape[1]}x{grid.shape[0]} of {whole} corners found: the board is "
                "partly out of view, or too small"
            )
        elif len(boards) > config.max_images:
            reasons[name] = f"{config.max_images} others are enough"
        else:
            reasons[name] = "does not fit the others"
    return reasons
