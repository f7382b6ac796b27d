"""Labels of several frames made consistent: which ground was seen, and where the ground ends.

The drone hardly moves while it learns, so all frames share one grid around it: azimuth and the
logarithm of the range at which a ray meets the ground. Every frame votes in each cell for ground or
for a surface in front of it.

- A label of ground needs the votes of other frames for its cell.
- A cell that was only ever hidden by a surface in front of it shows that surface in all frames.
- Beyond the last seen ground of an azimuth, where votes for surfaces exist, the ground ends: a wall
  hides everything that would lie there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.segmentation.geometry.labels import GROUND, NOT_GROUND, UNKNOWN
from uav_bt.errors import ShapeError
from uav_bt.types.arrays import Floats

_FADE: Final = 1e-6


@dataclass(frozen=True, kw_only=True)
class LimitConfig:
    """Grid and votes. Numbers are chosen on training scenes.

    Attributes:
        azimuths: Number of cells around.
        ranges: Number of cells from `nearest_m` to `farthest_m`.
        nearest_m: Range of the first cell.
        farthest_m: Range of the last cell.
        ground_share: Least share of the votes of a cell for ground.
        ground_votes: Least votes for ground, frames.
        doubted_share: Share of the votes for ground above which a label of not ground is dropped.
        filled_share: Share of votes above which unknown pixels of the cell become ground.
        filled_gap_px: Distance of such pixels from labels of not ground.
        other_votes: Votes for a surface in front of a cell that was never seen as ground, frames.
        border_px: Width of the strip at the border of the ground that becomes unknown.
    """

    azimuths: int = 180
    ranges: int = 80
    nearest_m: float = 0.3
    farthest_m: float = 15.0
    ground_share: float = 0.6
    ground_votes: float = 1.0
    doubted_share: float = 0.2
    filled_share: float = 0.9
    filled_gap_px: int = 5
    other_votes: float = 3.0
    border_px: int = 2


class Sighting(NamedTuple):
    """Labels of one frame, and where its rays meet the ground.

    Attributes:
        labels: (H, W) uint8 of `labels`.
        points_m: (H, W, 2), in the frame of the track; NaN where a ray does not meet the ground.
    """

    labels: NDArray[np.uint8]
    points_m: Floats


class _Cells(NamedTuple):
    azimuth: NDArray[np.intp]
    reach: NDArray[np.intp]
    known: NDArray[np.bool_]  # whether the ray meets the ground


def consistent(
    sightings: Sequence[Sighting], centre_m: Floats, config: LimitConfig | None = None
) -> list[tuple[NDArray[np.uint8], NDArray[np.float32]]]:
    """Return labels and confidences that agree between the frames, one pair for each frame.

    Args:
        sightings: of the frames.
        centre_m: (2,), middle of the grid: the place of the drone.
        config: grid and votes.

    Raises:
        ShapeError: there is no frame.
    """
    if not sightings:
        raise ShapeError("sightings of ground", expected="at least 1", actual=(0,))
    config = config or LimitConfig()
    cells = [_cells(each.points_m, centre_m, config) for each in sightings]
    ground, other = _votes(sightings, cells, config)
    share = ground / np.maximum(ground + other, _FADE)
    is_ground = (share >= config.ground_share) & (ground >= config.ground_votes)
    hidden = (other >= config.other_votes) & (ground < 0.05 * other)
    hidden |= _beyond(is_ground, other, config)
    made = []
    for (labels, _), (azimuth, reach, known) in zip(sightings, cells, strict=True):
        ours, here = labels.copy(), share[azimuth, reach]
        seen = is_ground[azimuth, reach] & known
        ours[(labels == GROUND) & ~seen] = UNKNOWN
        # Beside an object the windows take its motion. Ground that others saw there shows this.
        ours[(labels == NOT_GROUND) & known & (here > config.doubted_share)] = UNKNOWN
        ours[(ours == UNKNOWN) & hidden[azimuth, reach] & known] = NOT_GROUND
        apart = ~_grown(ours == NOT_GROUND, config.filled_gap_px)
        ours[(ours == UNKNOWN) & seen & (here >= config.filled_share) & apart] = GROUND
        ours[(ours == GROUND) & _grown(ours != GROUND, config.border_px)] = UNKNOWN
        sure = np.where(ours == GROUND, here, 1.0 - here)
        # An inferred label counts less than one from the frame itself.
        sure = np.where(ours == labels, 0.5 + 0.5 * sure, 0.5 * sure)
        sure = np.where(known, sure, 1.0)
        made.append((ours, np.where(ours == UNKNOWN, 0.0, sure).astype(np.float32)))
    return made


def _cells(points_m: Floats, centre_m: Floats, config: LimitConfig) -> _Cells:
    apart_m = points_m - centre_m
    range_m = np.linalg.norm(apart_m, axis=2)
    known = np.isfinite(range_m) & (range_m >= config.nearest_m)
    turn = np.arctan2(apart_m[..., 1], apart_m[..., 0]) / (2.0 * math.pi) + 0.5
    azimuth = (np.where(known, turn, 0.0) * config.azimuths).astype(np.intp) % config.azimuths
    grown = math.log(config.farthest_m / config.nearest_m)
    steps = np.log(np.where(known, range_m, 1.0) / config.nearest_m) / grown * config.ranges
    reach = np.clip(np.where(known, steps, 0.0).astype(np.intp), 0, config.ranges - 1)
    return _Cells(azimuth, reach, known)


def _votes(
    sightings: Sequence[Sighting], cells: Sequence[_Cells], config: LimitConfig
) -> tuple[Floats, Floats]:
    """Return the number of frames for ground and for a surface in front, (azimuths, ranges)."""
    shape = (config.azimuths, config.ranges)
    total = np.zeros((2, *shape))
    for (labels, _), (azimuth, reach, known) in zip(sightings, cells, strict=True):
        counts = np.zeros((2, *shape))
        for kind, label in enumerate((GROUND, NOT_GROUND)):
            chosen = known & (labels == label)
            np.add.at(counts[kind], (azimuth[chosen], reach[chosen]), 1.0)
        total += counts / np.maximum(counts.sum(axis=0), 1.0)
    ground, other = (_smoothed(each) for each in total)
    return ground, other


def _smoothed(votes: Floats) -> Floats:
    around = np.vstack([votes[-2:], votes, votes[:2]]).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(around, (3, 3), 0.7)[2:-2], np.float64)


def _beyond(is_ground: NDArray[np.bool_], other: Floats, config: LimitConfig) -> NDArray[np.bool_]:
    """Return the cells beyond the last ground of their azimuth, where a surface was seen."""
    last = np.where(
        is_ground.any(axis=1), config.ranges - 1 - np.argmax(is_ground[:, ::-1], axis=1), -1
    )
    last = np.maximum.reduce([np.roll(last, shift) for shift in (-1, 0, 1)])
    beyond = np.arange(config.ranges)[None, :] >= last[:, None] + 2
    stands = np.where(beyond, other, 0.0).max(axis=1) >= 0.5 * config.other_votes
    return np.asarray(beyond & stands[:, None])


def _grown(mask: NDArray[np.bool_], by_px: int) -> NDArray[np.bool_]:
    around = np.ones((2 * by_px + 1, 2 * by_px + 1), np.uint8)
    grown = cv2.dilate(
        mask.astype(np.uint8), around, borderType=cv2.BORDER_CONSTANT, borderValue=(0,)
    )
    return np.asarray(grown, bool)
