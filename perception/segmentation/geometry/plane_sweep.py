"""Plane sweep: how well level planes at several heights explain the motion between frames.

The ray of a pixel meets the ground at a depth d. A surface that it meets at the depth d / (1 + u)
stands above the ground (u > 0). A level plane through that point gives a homography between two
frames, so one value of u is tested by one warp of the other frame. `u` is proportional to the
parallax against the ground: zero on the ground, and negative only where a match is wrong.

The similarity is a correlation in square windows, regularised by the noise of the image: it is low
without texture, and does not depend on brightness. Small windows place borders exactly, large ones
see the weak texture of walls.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import CameraView
from uav_bt.errors import ShapeError
from uav_bt.types.arrays import Floats
from uav_bt.types.projection import camera_axes

Map = NDArray[np.float32]

_OUTSIDE: Final = -1e4  # grey level outside an image
_NONE: Final = np.float32(-1.0)  # similarity of what no other frame shows


@dataclass(frozen=True, kw_only=True)
class SweepConfig:
    """Planes, windows and tolerances. Numbers are chosen on training scenes.

    Attributes:
        windows_px: Sides of the square windows, odd, the smallest first.
        largest: Largest u: a surface at a fifth of the ground's depth.
        step: First step between two values of u.
        growth: Relative growth of the steps.
        below: Largest -u, for wrong matches.
        noise: Variance of the image noise, grey levels squared, times a few.
        on_ground_px: Parallax up to which a match is on the ground: the error of the motion.
        off_ground_px: Parallax from which a match is off the ground.
        on_ground: |u| up to which a match is on the ground at any parallax.
        off_ground: |u| from which a match is off the ground.
    """

    windows_px: tuple[int, ...] = (7, 15, 25)
    largest: float = 4.0
    step: float = 0.02
    growth: float = 0.09
    below: float = 0.16
    noise: float = 3.0
    on_ground_px: float = 0.8
    off_ground_px: float = 2.0
    on_ground: float = 0.021
    off_ground: float = 0.06

    def values(self) -> Floats:
        """Return the values of u, rising."""
        above = [0.0]
        while above[-1] < self.largest:
            above.append(above[-1] + max(self.step, self.growth * above[-1]))
        under = np.arange(-self.below, -self.step / 2.0, self.step)
        return np.concatenate([under, above])


@dataclass(frozen=True, kw_only=True, eq=False)
class OtherFrame:
    """Another frame of the same camera.

    Attributes:
        grey: (H, W) float32.
        motion: (3, 4), transform of points from the reference camera to this one, metres.
        before: Whether it was captured before the reference. What an object hides from one side is
            usually seen from the other.
    """

    grey: Map
    motion: Floats
    before: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class SweepScores:
    """Best similarities of each pixel, -1 to 1, for each window: (windows, H, W) float32.

    Attributes:
        ground: On the ground.
        above: Above the ground.
        below: Below the ground, where no surface is: the level of chance.
        parallax_px: (H, W), parallax per unit of u.
    """

    ground: Map
    above: Map
    below: Map
    parallax_px: Map


def sweep(
    grey: Map, view: CameraView, others: Sequence[OtherFrame], config: SweepConfig | None = None
) -> SweepScores:
    """Compare a frame with others under the hypothesis of each plane.

    Args:
        grey: (H, W) float32, the reference frame.
        view: its camera at that size, height and pitch.
        others: at least one other frame.
        config: planes and windows.

    Raises:
        ShapeError: there is no other frame, or one of another size.
    """
    config = config or SweepConfig()
    shape = (view.camera.height_px, view.camera.width_px)
    for image in (grey, *(other.grey for other in others)):
        if image.shape != shape:
            expected = f"{shape[0]}x{shape[1]}, as its camera"
            raise ShapeError("frame of a plane sweep", expected=expected, actual=image.shape)
    if not others:
        raise ShapeError("other frames of a plane sweep", expected="at least 1", actual=(0,))
    parallax_px = np.mean([_parallax(view, other.motion) for other in others], axis=0)
    windows = [_Window(grey, side, config.noise) for side in config.windows_px]
    best = np.full((3, len(windows), *shape), _NONE, np.float32)
    for value in config.values():
        kinds = _kinds(float(value), parallax_px, config)
        if not any(kind.any() for kind in kinds):
            continue
        for index, score in enumerate(_scores(windows, grey, view, others, float(value))):
            for kind, place in zip(best, kinds, strict=True):
                np.maximum(kind[index], score, out=kind[index], where=place)
    return SweepScores(
        ground=best[0],
        above=best[1],
        below=best[2],
        parallax_px=np.asarray(parallax_px, np.float32),
    )


def homography(view: CameraView, motion: Floats, u: float) -> Floats:
    """Return the homography from a frame to another one that a level plane causes, (3, 3).

    Args:
        view: camera of the first frame.
        motion: (3, 4), transform of points from its camera to the other's.
        u: the plane; 0 is the ground.
    """
    camera = view.camera
    inner = np.array(
        [[camera.fx_px, 0.0, camera.cx_px], [0.0, camera.fy_px, camera.cy_px], [0.0, 0.0, 1.0]]
    )
    down = camera_axes(view.pitch_rad, view.roll_rad)[2]
    moved = motion[:, :3] + np.outer(motion[:, 3], down) * (1.0 + u) / view.height_m
    return np.asarray(inner @ moved @ np.linalg.inv(inner))


def _parallax(view: CameraView, motion: Floats) -> Floats:
    """Return the shift per unit of u, (H, W) px; 0 where a point is behind the other camera."""
    columns, rows = np.meshgrid(
        np.arange(view.camera.width_px, dtype=float), np.arange(view.camera.height_px, dtype=float)
    )
    pixels = np.stack([columns, rows, np.ones_like(columns)], axis=2)
    small = 0.05
    places = []
    for u in (0.0, small):
        there = pixels @ homography(view, motion, u).T
        depth = np.where(there[..., 2:] > 1e-6, there[..., 2:], np.nan)
        places.append(there[..., :2] / depth)
    shift = np.linalg.norm(places[1] - places[0], axis=2) / small
    return np.asarray(np.nan_to_num(shift))


def _kinds(u: float, parallax_px: Floats, config: SweepConfig) -> tuple[NDArray[np.bool_], ...]:
    """Return where a value of u is on, above and below the ground, each (H, W)."""
    shift = u * parallax_px
    on = (np.abs(shift) <= config.on_ground_px) | (abs(u) <= config.on_ground)
    above = (shift >= config.off_ground_px) & (u >= config.off_ground)
    below = (shift <= -config.off_ground_px) & (u <= -config.off_ground)
    return on, above, below


class _Window:
    """Sums of the reference frame in square windows."""

    def __init__(self, grey: Map, side_px: int, noise: float) -> None:
        self._side, self._grey, self._noise = (side_px, side_px), grey, noise
        self._mean = self.mean(grey)
        self._variance = self.mean(grey * grey) - self._mean**2

    def mean(self, image: Map) -> Map:
        """Return the mean in the window around each pixel."""
        reflected = cv2.BORDER_REFLECT
        return np.asarray(cv2.boxFilter(image, cv2.CV_32F, self._side, borderType=reflected))

    def similarity(self, image: Map, inside: Map) -> Map:
        """Return the similarity with a warped frame; NaN where its image ends."""
        mean = self.mean(image)
        variance = self.mean(image * image) - mean**2
        together = self.mean(self._grey * image) - self._mean * mean
        score = 2.0 * together / (self._variance + variance + self._noise)
        score[(inside == 0.0) | (self.mean(inside) < 0.8)] = np.nan
        return np.asarray(score)


def _scores(
    windows: Sequence[_Window], grey: Map, view: CameraView, others: Sequence[OtherFrame], u: float
) -> list[Map]:
    """Return the similarity for one plane and each window: the better side's mean, (H, W)."""
    size = (view.camera.width_px, view.camera.height_px)
    sums = np.zeros((len(windows), 2, size[1], size[0]), np.float32)
    counts = np.zeros_like(sums)
    for other in others:
        warped = cv2.warpPerspective(
            other.grey,
            homography(view, other.motion, u),
            size,
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=(_OUTSIDE,),
        )
        inside = (warped > _OUTSIDE / 200.0).astype(np.float32)
        filled = np.where(inside > 0.0, warped, grey).astype(np.float32)
        for index, window in enumerate(windows):
            score = window.similarity(filled, inside)
            known = np.isfinite(score)
            sums[index, int(other.before)] += np.where(known, score, 0.0)
            counts[index, int(other.before)] += known
    means = np.where(counts > 0.0, sums / np.maximum(counts, 1.0), _NONE)
    return list(means.max(axis=1))
