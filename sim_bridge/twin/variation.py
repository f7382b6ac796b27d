"""Scenes drawn from a scene: other light, other places and heights of its boxes."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from sim_bridge.twin.scene import CARPET_SIZE_M, BoxSpec, Helipad, Lighting, Scene, layout_problem
from uav_bt.errors import ValueRangeError

_FROM_EDGE_M: Final = 0.4  # of a box's centre: a drone does not fly round it there
# Between the centres of two boxes, so that most gaps let the drone through, and from box to pad.
_APART_M: Final = 1.05
_FROM_PAD_M: Final = 0.95
_SIDES_M: Final = (0.3, 0.5)
_HEIGHTS_M: Final = (0.6, 2.2)  # as the shipped scenes have them
_HIGH_SHARE: Final = 0.6  # of boxes that reach the flight height, 1.5 m
_HIGH_M: Final = 1.5
_TRIES: Final = 4000


def varied_light(rng: np.random.Generator) -> Lighting:
    """Return a lab's light at random; cast shadows are left out, they cost 10 ms a frame."""
    azimuth = rng.uniform(0.0, 2.0 * math.pi)
    slant = rng.uniform(0.2, 0.9)
    return Lighting(
        ambient=round(float(rng.uniform(0.25, 0.6)), 3),
        direction=(
            round(slant * math.cos(azimuth), 3),
            round(slant * math.sin(azimuth), 3),
            -1.0,
        ),
    )


def varied_scene(scene: Scene, rng: np.random.Generator, *, name: str, layout: bool) -> Scene:
    """Return a scene in another light and, if asked, with its boxes elsewhere, of other sizes.

    Args:
        scene: keeps its helipad and its boxes' patterns.
        rng: the source of all that is drawn.
        name: of the new one.
        layout: whether the boxes move.

    Raises:
        ValueRangeError: there is no room for so many boxes.
    """
    boxes = _placed(scene, rng) if layout else scene.boxes
    return replace(scene, name=name, boxes=boxes, lighting=varied_light(rng))


def _placed(scene: Scene, rng: np.random.Generator) -> tuple[BoxSpec, ...]:
    placed: list[BoxSpec] = []
    for _ in range(_TRIES):
        if len(placed) == len(scene.boxes):
            return tuple(placed)
        box = _drawn(scene.boxes[len(placed)].pattern, rng)
        if _fits(box, placed, scene.helipad):
            placed.append(box)
        elif rng.random() < 0.01:  # a bad beginning leaves no room for the rest
            placed.clear()
    raise ValueRangeError(f"no room for {len(scene.boxes)} boxes in scene '{scene.name}'")


def _drawn(pattern: int, rng: np.random.Generator) -> BoxSpec:
    high = rng.random() < _HIGH_SHARE
    heights = (_HIGH_M, _HEIGHTS_M[1]) if high else (_HEIGHTS_M[0], _HIGH_M)
    across, along = (side / 2 - _FROM_EDGE_M for side in CARPET_SIZE_M)
    return BoxSpec(
        pattern=pattern,
        position_m=(_rounded(rng, -across, across), _rounded(rng, -along, along)),
        yaw_deg=_rounded(rng, -90.0, 90.0),
        size_m=(_rounded(rng, *_SIDES_M), _rounded(rng, *_SIDES_M), _rounded(rng, *heights)),
    )


def _rounded(rng: np.random.Generator, low: float, high: float) -> float:
    return round(float(rng.uniform(low, high)), 2)


def _fits(box: BoxSpec, placed: list[BoxSpec], helipad: Helipad) -> bool:
    apart = all(math.dist(box.position_m, other.position_m) >= _APART_M for other in placed)
    if not apart or math.dist(box.position_m, helipad.position_m) < _FROM_PAD_M:
        return False
    return layout_problem(helipad, (*placed, box)) is None
