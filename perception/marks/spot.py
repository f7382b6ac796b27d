"""The take-off spot as a landing mark: the texture of the ground around it, without any print.

After the take-off a picture of the ground is collected, while the drone is still above the spot.
Later views straight down are registered against it. The map's estimate of the take-off pose limits
the search, because many floors repeat: among displacements that agree about as well, the nearest to
the estimate counts, and only if the next one is much further away. Numbers without a reason are
chosen.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from perception.marks.ground_texture import (
    Displacement,
    GroundTexture,
    KnownGround,
    ground_texture,
    mean_texture,
)
from uav_bt.landing_marks import MarkSighting, MarkView, Options, read_options
from uav_bt.types import LandingMark, Pose2D
from uav_bt.types.arrays import Image

_MIN_HEIGHT_M: Final = 0.7  # lower views show too little ground
_NEAR_M: Final = 0.3  # a view up to this distance from the take-off pose is collected
_PICTURES: Final = 8  # most views in the remembered picture
_MIN_PICTURES: Final = 3  # fewer views at the take-off give no picture
_REACH_M: Final = 1.0  # largest displacement from the estimated spot along each axis
_MIN_SHARED_M2: Final = 0.4  # area that view and picture have in common
_TURNS_RAD: Final = tuple(map(math.radians, (-4.0, -2.0, 0.0, 2.0, 4.0)))  # of the estimate
_MIN_SCORE: Final = 0.5  # correlation; right displacements in 11 rooms had 0.6 and more
_RIVAL_SHARE: Final = 0.75  # displacements with this share of the best correlation are possible
_RIVAL_RATIO: Final = 0.35  # the nearest of them counts up to this share of the second's distance
_AGREE_M: Final = 0.1  # two views in a row must find the spot within this distance,
_AGREE_S: Final = 1.0  # and within this time


class _Match(NamedTuple):
    captured_s: float
    spot: Displacement  # from the estimate, in the estimated take-off frame
    frame: Pose2D  # that frame relative to the body, with the found heading


class SpotFinder:
    """Finds the take-off spot by the texture of the ground; implements `MarkFinder`.

    A finder belongs to one flight, and sees the views in their order. Raises ValueRangeError for a
    mark with an option: this kind has none.
    """

    uses_images = True
    shows_heading = False

    def __init__(self, mark: LandingMark) -> None:
        read_options(mark, Options)
        self._pictures: list[GroundTexture] | None = []  # None: collected
        self._known: KnownGround | None = None
        self._last: _Match | None = None

    def find(self, view: MarkView) -> MarkSighting | None:
        """Return the spot in a view straight down near it; None without texture that shows it."""
        take_off = view.take_off
        if take_off is None or view.frame.height_above_ground_m < _MIN_HEIGHT_M:
            return None
        if self._pictures is not None:
            self._collect(view, take_off, self._pictures)
            return None
        last, self._last = self._last, self._match(view, take_off)
        match = self._last
        if match is None or last is None or match.captured_s - last.captured_s > _AGREE_S:
            return None
        spot = match.spot
        if math.hypot(spot.x_m - last.spot.x_m, spot.y_m - last.spot.y_m) > _AGREE_M:
            return None
        forward_m, right_m = match.frame.to_world(spot.x_m, spot.y_m)
        return MarkSighting(
            forward_m=forward_m, right_m=right_m, height_m=0.0, confidence=min(1.0, spot.score)
        )

    def picture(self) -> Image:
        """Return a plain grey top, (64, 64, 3) RGB."""
        return np.full((64, 64, 3), 128, dtype=np.uint8)

    def _collect(self, view: MarkView, take_off: Pose2D, pictures: list[GroundTexture]) -> None:
        """Add a view at the take-off to the picture, or complete the picture."""
        left = math.hypot(take_off.x_m, take_off.y_m) > _NEAR_M
        picture = None if left else ground_texture(view, take_off)
        if picture is not None:
            pictures.append(picture)
        if left or len(pictures) >= _PICTURES:
            self._pictures = None
            if len(pictures) >= _MIN_PICTURES:
                self._known = KnownGround(mean_texture(pictures), _REACH_M)

    def _match(self, view: MarkView, take_off: Pose2D) -> _Match | None:
        """Return the accepted displacement of a view; None without one."""
        far = math.hypot(take_off.x_m, take_off.y_m) > math.sqrt(2.0) * _REACH_M
        if self._known is None or far:
            return None
        best: tuple[list[Displacement], Pose2D] | None = None
        for turn_rad in _TURNS_RAD:
            frame = Pose2D(x_m=take_off.x_m, y_m=take_off.y_m, yaw_rad=take_off.yaw_rad + turn_rad)
            picture = ground_texture(view, frame)
            if picture is None:
                return None
            found = self._known.displacements(
                picture, min_shared_m2=_MIN_SHARED_M2, least=_MIN_SCORE * _RIVAL_SHARE
            )
            if found and (best is None or found[0].score > best[0][0].score):
                best = found, frame
        spot = None if best is None else _nearest(best[0])
        if best is None or spot is None:
            return None
        return _Match(view.frame.captured_s, spot, best[1])


def _nearest(found: list[Displacement]) -> Displacement | None:
    """Return the displacement nearest to the estimate, unless another may be meant; best first."""
    top = found[0].score
    if top < _MIN_SCORE:
        return None
    possible = [each for each in found if each.score >= _RIVAL_SHARE * top]
    possible.sort(key=lambda each: each.range_m)
    unclear = len(possible) > 1 and possible[0].range_m > _RIVAL_RATIO * possible[1].range_m
    return None if unclear else possible[0]
