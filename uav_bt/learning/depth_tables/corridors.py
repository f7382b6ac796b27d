"""Comparison of the safety corridors in estimated and in exact depth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from perception.camera.ground_plane import view_of
from perception.depth.corridor import CorridorBuilder, CorridorConfig
from uav_bt.learning.depth_tables.images import MAP_SIZE_PX, Masks, SampleImage
from uav_bt.learning.depth_tables.methods import methods_for, metric_maps
from uav_bt.progress import Advance, silent
from uav_bt.types import Corridor, DepthMap

FRONTS_M: Final = (0.3, 0.5, 1.0, 1.5, 2.0, 3.0)
FOCAL_FACTORS: Final = (0.8, 0.9, 1.0, 1.1, 1.2)
_CLEARLY_M: Final = 0.1  # shift of the planes that must not change a clear result


@dataclass(frozen=True, kw_only=True)
class CorridorRow:
    """Errors of the corridor in the depth of one method.

    Images without depth do not count as errors: a flight then has no corridor and stops.
    """

    method: str
    front_m: float  # distance of the front plane from the drone's centre
    focal_factor: float  # f of the estimated corridor; the true corridor has f = 1
    images: int
    without_depth: int  # images without depth; the fields below count only the others
    intruded: int  # images with a true intrusion
    false_alarms: int  # images with a false intrusion
    misses: int  # images with a missed intrusion
    # The same, only where a shift of the planes by `_CLEARLY_M` would not change the truth.
    clear_false_alarms: int
    clear_misses: int
    nearest_error_m: float  # mean absolute error of true positives; NaN without any


def corridor_table(
    images: Sequence[SampleImage], masks: Masks, *, advance: Advance = silent
) -> list[CorridorRow]:
    """Sweep the front plane and the focal factor.

    Args:
        images: the images.
        masks: source of the masks, which separate objects from ground and background and give the
            ground contacts.
        advance: called after each setting.
    """
    settings = [CorridorConfig(front_m=front_m) for front_m in FRONTS_M]
    settings += [CorridorConfig(focal_factor=factor) for factor in FOCAL_FACTORS]
    names = ("adaptive", "fused", "flown", "contact")
    maps = {
        method.name: metric_maps(method, images, masks)
        for method in methods_for(images)
        if method.name in names
    }
    rows = []
    for done, config in enumerate(settings, start=1):
        truths = [_truths(image, config) for image in images]
        for name, found in maps.items():
            seen_and_true = [
                (_seen(image, map_, masks, config), truth)
                for image, map_, truth in zip(images, found, truths, strict=True)
                if np.isfinite(map_.depth).any()
            ]
            rows.append(_row(name, config, seen_and_true, len(images)))
        advance("corridor", done, len(settings))
    return rows


@dataclass(frozen=True, kw_only=True)
class _Truth:
    """The true corridor, and the same narrower and wider."""

    exact: Corridor
    narrow: Corridor
    wide: Corridor


def _truths(image: SampleImage, config: CorridorConfig) -> _Truth:
    plain = replace(config, focal_factor=1.0)
    depth = DepthMap(depth=image.depth_m, metric=True, captured_s=image.frame.captured_s)

    def build(by_m: float) -> Corridor:
        walls = replace(
            plain,
            side_m=plain.side_m + by_m,
            up_down_m=plain.up_down_m + by_m,
            # The front plane must stay ahead of the lens.
            front_m=max(plain.front_m + by_m, image.camera.forward_offset_m + 0.03),
        )
        things = image.exact.is_above_ground
        return CorridorBuilder(walls).build(depth, image.truth, things=things)

    return _Truth(exact=build(0.0), narrow=build(-_CLEARLY_M), wide=build(_CLEARLY_M))


def _seen(image: SampleImage, depth: DepthMap, masks: Masks, config: CorridorConfig) -> Corridor:
    view = view_of(image.frame, image.camera, MAP_SIZE_PX)
    things = image.masks[masks].is_above_ground
    return CorridorBuilder(config).build(depth, view, things=things)


def _row(
    name: str, config: CorridorConfig, seen_and_true: Sequence[tuple[Corridor, _Truth]], images: int
) -> CorridorRow:
    alarm, real, narrow, wide = (
        np.array([corridor.nearest_side is not None for corridor in corridors], dtype=bool)
        for corridors in (
            [seen for seen, _ in seen_and_true],
            [truth.exact for _, truth in seen_and_true],
            [truth.narrow for _, truth in seen_and_true],
            [truth.wide for _, truth in seen_and_true],
        )
    )
    errors_m = [
        abs(seen.nearest_m - truth.exact.nearest_m)
        for seen, truth in seen_and_true
        if seen.nearest_side is not None and truth.exact.nearest_side is not None
    ]
    return CorridorRow(
        method=name,
        front_m=config.front_m,
        focal_factor=config.focal_factor,
        images=images,
        without_depth=images - len(seen_and_true),
        intruded=int(real.sum()),
        false_alarms=int((alarm & ~real).sum()),
        misses=int((~alarm & real).sum()),
        clear_false_alarms=int((alarm & ~wide).sum()),
        clear_misses=int((~alarm & narrow).sum()),
        nearest_error_m=float(np.mean(errors_m)) if errors_m else math.nan,
    )
