"""The safety corridor in estimated depth, beside the one in exact depth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from perception.camera.ground_plane import view_of
from perception.obstacles.corridor import CorridorConfig, CorridorPlanes, build_corridor
from uav_bt.classes import CARPET
from uav_bt.learning.depth_tables.images import MAP_SIZE_PX, Masks, Picture
from uav_bt.learning.depth_tables.methods import methods_for, metric_maps
from uav_bt.progress import Advance, silent
from uav_bt.types import Corridor, DepthMap

__all__ = ["FOCAL_FACTORS", "FRONTS_M", "CorridorRow", "corridor_table"]

FRONTS_M: Final = (0.3, 0.5, 1.0, 1.5, 2.0, 3.0)
FOCAL_FACTORS: Final = (0.8, 0.9, 1.0, 1.1, 1.2)
_CLEARLY_M: Final = 0.1  # by which walls move before an intrusion is beyond dispute


@dataclass(frozen=True, kw_only=True)
class CorridorRow:
    """How often the corridor in a method's depth is wrong.

    Pictures without any depth are not counted as seen wrongly: a flight then has no corridor, knows
    it, and stops.
    """

    method: str
    front_m: float  # the front plane, from the drone's centre
    focal_factor: float  # f of the estimated corridor; the true one has f = 1
    pictures: int
    without_depth: int  # of these; the figures below are about the others
    intruded: int  # with a true intrusion
    false_alarms: int  # an intrusion that is none
    misses: int  # a true intrusion that is not seen
    # Likewise, where walls a hand's breadth further in or out would not have changed the truth.
    clear_false_alarms: int
    clear_misses: int
    nearest_error_m: float  # mean absolute, where both see an intrusion; NaN where none do


def corridor_table(
    pictures: Sequence[Picture], masks: Masks, *, advance: Advance = silent
) -> list[CorridorRow]:
    """Sweep the front plane and the focal factor.

    Args:
        pictures: what is looked at.
        masks: whose masks tell things from carpet and background, and give footing.
        advance: told after every setting.
    """
    settings = [CorridorConfig(front_m=front_m) for front_m in FRONTS_M]
    settings += [CorridorConfig(focal_factor=factor) for factor in FOCAL_FACTORS]
    names = ("adaptive", "fused", "footing")
    maps = {
        method.name: metric_maps(method, pictures, masks)
        for method in methods_for(pictures)
        if method.name in names
    }
    rows = []
    for done, config in enumerate(settings, start=1):
        truths = [_truths(picture, config) for picture in pictures]
        for name, found in maps.items():
            told = [
                (_seen(picture, map_, masks, config), truth)
                for picture, map_, truth in zip(pictures, found, truths, strict=True)
                if np.isfinite(map_.depth).any()
            ]
            rows.append(_row(name, config, told, len(pictures)))
        advance("corridor", done, len(settings))
    return rows


@dataclass(frozen=True, kw_only=True)
class _Truth:
    """The true corridor, a narrower and a wider one."""

    exact: Corridor
    narrow: Corridor
    wide: Corridor


def _truths(picture: Picture, config: CorridorConfig) -> _Truth:
    plain = replace(config, focal_factor=1.0)
    depth = DepthMap(depth=picture.depth_m, metric=True, captured_s=picture.frame.captured_s)
    offset_m = picture.camera.forward_offset_m

    def build(by_m: float) -> Corridor:
        walls = replace(
            plain,
            left_m=plain.left_m + by_m,
            right_m=plain.right_m + by_m,
            up_m=plain.up_m + by_m,
            down_m=plain.down_m + by_m,
            # The front plane stays ahead of the lens, or there is no corridor to look into.
            front_m=max(plain.front_m + by_m, offset_m + 0.03),
        )
        planes = CorridorPlanes.of(picture.truth, walls)
        things = picture.ids > CARPET
        return build_corridor(depth, planes, offset_m=offset_m, things=things, config=walls)

    return _Truth(exact=build(0.0), narrow=build(-_CLEARLY_M), wide=build(_CLEARLY_M))


def _seen(picture: Picture, depth: DepthMap, masks: Masks, config: CorridorConfig) -> Corridor:
    return build_corridor(
        depth,
        CorridorPlanes.of(view_of(picture.frame, picture.camera, MAP_SIZE_PX), config),
        offset_m=picture.camera.forward_offset_m,
        things=picture.masks[masks].ids > CARPET,
        config=config,
    )


def _row(
    name: str, config: CorridorConfig, told: Sequence[tuple[Corridor, _Truth]], pictures: int
) -> CorridorRow:
    alarm, real, narrow, wide = (
        np.array([corridor.nearest_side is not None for corridor in corridors], dtype=bool)
        for corridors in (
            [seen for seen, _ in told],
            [truth.exact for _, truth in told],
            [truth.narrow for _, truth in told],
            [truth.wide for _, truth in told],
        )
    )
    errors_m = [
        abs(seen.nearest_m - truth.exact.nearest_m)
        for seen, truth in told
        if seen.nearest_side is not None and truth.exact.nearest_side is not None
    ]
    return CorridorRow(
        method=name,
        front_m=config.front_m,
        focal_factor=config.focal_factor,
        pictures=pictures,
        without_depth=pictures - len(told),
        intruded=int(real.sum()),
        false_alarms=int((alarm & ~real).sum()),
        misses=int((~alarm & real).sum()),
        clear_false_alarms=int((alarm & ~wide).sum()),
        clear_misses=int((~alarm & narrow).sum()),
        nearest_error_m=float(np.mean(errors_m)) if errors_m else math.nan,
    )
