"""The take-off spot as a landing mark: the texture of the ground around it, without any print.

After the take-off a bird's-eye picture of the ground is collected, while the drone is still above
the spot. Later views straight down are registered against it. The map's estimate of the take-off
pose limits the search, because many floors repeat: among displacements that agree about as well,
the nearest to the estimate counts, and only if the next one is much further away.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from perception.marks.ground_match import Candidate, KnownGround, candidates
from perception.marks.ground_picture import GroundMosaic, ground_picture
from perception.marks.options import Options, read_options
from uav_bt.landing_marks import MarkSighting, MarkView
from uav_bt.types import LandingMark, Pose2D
from uav_bt.types.arrays import Image

_COLOUR: Final = (128, 128, 128)
_PICTURE_PX: Final = 64


@dataclass(frozen=True, kw_only=True)
class SpotConfig:
    """Views that count, and displacements that are accepted. Numbers without a reason are chosen.

    Attributes:
        min_height_m: Lower views show too little ground.
        near_m: A view up to this distance from the take-off pose is collected.
        pictures: Largest number of views in the remembered picture.
        min_pictures: Fewer views at the take-off give no picture.
        reach_m: Largest displacement from the estimated spot along each axis.
        min_shared_m2: Least area that view and picture have in common.
        turns_rad: Errors of the estimated heading that are tried.
        min_score: Least correlation. Right displacements in 11 rooms had 0.6 and more.
        rival_share: Displacements with this share of the best correlation are possible, too.
        rival_ratio: The nearest of them counts if its distance from the estimate is at most this
            share of the second nearest's.
        agree_m: Two views in a row must find the spot within this distance.
        agree_s: Time between those views at most.
    """

    min_height_m: float = 0.7
    near_m: float = 0.3
    pictures: int = 8
    min_pictures: int = 3
    reach_m: float = 1.0
    min_shared_m2: float = 0.4
    turns_rad: tuple[float, ...] = tuple(map(math.radians, (-4.0, -2.0, 0.0, 2.0, 4.0)))
    min_score: float = 0.5
    rival_share: float = 0.75
    rival_ratio: float = 0.35
    agree_m: float = 0.1
    agree_s: float = 1.0


@dataclass(frozen=True, kw_only=True)
class _Match:
    """The spot in one view."""

    captured_s: float
    spot: Candidate  # displacement from the estimate, in the estimated take-off frame
    frame: Pose2D  # that frame relative to the body, with the found heading


class SpotFinder:
    """Finds the take-off spot by the texture of the ground; implements `MarkFinder`.

    A finder belongs to one flight, and sees the views in their order.

    Args:
        mark: Its size is not used; the spot is at the height of the ground.
        config: Views that count, and displacements that are accepted.

    Raises:
        ValueRangeError: The mark has an option: this kind has none.
    """

    uses_images = True
    shows_heading = False

    def __init__(self, mark: LandingMark, config: SpotConfig | None = None) -> None:
        read_options(mark, Options)
        self._config = config or SpotConfig()
        self._mosaic: GroundMosaic | None = GroundMosaic()  # None: collected
        self._known: KnownGround | None = None
        self._last: _Match | None = None

    def find(self, view: MarkView) -> MarkSighting | None:
        """Return the spot in a view straight down near it; None without texture that shows it."""
        take_off = view.take_off
        high = view.frame.height_above_ground_m >= self._config.min_height_m
        if take_off is None or not high:
            return None
        if self._mosaic is not None:
            self._collect(view, take_off, self._mosaic)
            return None
        match = self._match(view, take_off)
        last, self._last = self._last, match
        if match is None or last is None or not self._agree(last, match):
            return None
        forward_m, right_m = match.frame.to_world(match.spot.x_m, match.spot.y_m)
        return MarkSighting(
            forward_m=forward_m,
            right_m=right_m,
            height_m=0.0,
            confidence=min(1.0, match.spot.score),
        )

    def picture(self) -> Image:
        """Return a plain grey top, (64, 64, 3) RGB."""
        return np.full((_PICTURE_PX, _PICTURE_PX, 3), _COLOUR, dtype=np.uint8)

    def _collect(self, view: MarkView, take_off: Pose2D, mosaic: GroundMosaic) -> None:
        """Add a view at the take-off to the picture, or complete the picture."""
        cfg = self._config
        left = math.hypot(take_off.x_m, take_off.y_m) > cfg.near_m
        picture = None if left else ground_picture(view, take_off)
        if picture is not None:
            mosaic.add(picture)
        if left or mosaic.pictures >= cfg.pictures:
            self._mosaic = None
            if mosaic.pictures >= cfg.min_pictures:
                self._known = KnownGround(mosaic.picture(), cfg.reach_m)

    def _match(self, view: MarkView, take_off: Pose2D) -> _Match | None:
        """Return the accepted displacement of a view; None without one."""
        cfg = self._config
        if self._known is None:
            return None
        if math.hypot(take_off.x_m, take_off.y_m) > math.sqrt(2.0) * cfg.reach_m:
            return None
        best: tuple[list[Candidate], Pose2D] | None = None
        for turn_rad in cfg.turns_rad:
            frame = Pose2D(x_m=take_off.x_m, y_m=take_off.y_m, yaw_rad=take_off.yaw_rad + turn_rad)
            picture = ground_picture(view, frame)
            if picture is None:
                return None
            correlation = self._known.correlation(picture, cfg.min_shared_m2)
            found = candidates(correlation, least=cfg.min_score * cfg.rival_share)
            if found and (best is None or found[0].score > best[0][0].score):
                best = found, frame
        if best is None:
            return None
        spot = self._believed(best[0])
        captured_s = view.frame.captured_s
        return None if spot is None else _Match(captured_s=captured_s, spot=spot, frame=best[1])

    def _believed(self, found: list[Candidate]) -> Candidate | None:
        """Return the displacement that is nearest to the estimate, unless another may be meant.

        Args:
            found: At least one, best first.
        """
        cfg, top = self._config, found[0].score
        if top < cfg.min_score:
            return None
        possible = [each for each in found if each.score >= cfg.rival_share * top]
        possible.sort(key=lambda each: each.range_m)
        unclear = len(possible) > 1 and possible[0].range_m > cfg.rival_ratio * possible[1].range_m
        return None if unclear else possible[0]

    def _agree(self, last: _Match, match: _Match) -> bool:
        """Return whether two views find the spot at one place."""
        apart_m = math.hypot(match.spot.x_m - last.spot.x_m, match.spot.y_m - last.spot.y_m)
        soon = match.captured_s - last.captured_s <= self._config.agree_s
        return soon and apart_m <= self._config.agree_m
