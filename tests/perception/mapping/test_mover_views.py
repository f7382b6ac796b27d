"""Movers on exact views of the twin's lab, and what has arrived on free ground."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from perception.mapping.ground_grid import GroundGrid
from perception.mapping.landmarks import Landmarks
from perception.mapping.movers import find_arrivals, hidden_arrival
from perception.mapping.site_mapper import SiteMapper
from tests.paper_lab import BOXES, CARPET, CLASSES
from tests.perception.mapping.mapping_world import (
    AT_START,
    CAMERA,
    HEIGHT_M,
    PITCH_RAD,
    look,
    points,
)
from uav_bt.types import Pose2D
from uav_bt.types.arrays import Floats
from uav_bt.types.projection import pixel_rays
from uav_bt.types.site_map import SiteMap

Place = tuple[float, float]
STEP_S = 0.1
SIDE_M = 0.4
BOX_M, BOX_ID = (1.6, -1.0), BOXES[2]
CART_ID = BOXES[4]
Places = list[Place | None]


def class_ids(cart_m: Place | None, height_m: float, *, box: bool) -> NDArray[np.uint8]:
    """Return the view of a drone at (-1, 0): endless ground, a high box and a high cart."""
    rows, columns = np.indices((112, 224))
    rays = pixel_rays(np.stack([columns, rows], axis=-1), CAMERA, PITCH_RAD)
    ids, nearest = np.full((112, 224), CARPET, dtype=np.uint8), height_m / rays[..., 2]
    things = [(BOX_M, BOX_ID)] * box + ([] if cart_m is None else [(cart_m, CART_ID)])
    for (x_m, y_m), class_id in things:
        middle_m = np.array([x_m + 1.0 - CAMERA.forward_offset_m, y_m])
        with np.errstate(divide="ignore"):
            ends = [(middle_m + half_m) / rays[..., :2] for half_m in (-SIDE_M / 2, SIDE_M / 2)]
        enters, leaves = np.minimum(*ends).max(axis=-1), np.maximum(*ends).min(axis=-1)
        hit = (enters <= leaves) & (leaves > 0.0) & (enters < nearest)
        ids[hit], nearest[hit] = class_id, enters[hit]
    return ids


def mapped(
    places: Sequence[Place | None],
    mapper: SiteMapper | None = None,
    height_m: float = HEIGHT_M,
    *,
    box: bool = True,
) -> list[SiteMap]:
    """Return the map after each view of a drone that hovers, 0.1 s apart."""
    maps, mapper = [], mapper or SiteMapper(CLASSES)
    for index, place in enumerate(places):
        pose = replace(AT_START, time_s=index * STEP_S, x_m=-1.0)
        ids = class_ids(place, height_m, box=box)
        maps.append(look(mapper, ids, pose, height_m=height_m))
    return maps


EMPTY: Places = [None] * 4
CROSSING: Places = [(0.8, -1.1 + 0.05 * step) for step in range(36)]


def near(points_m: Floats, x_m: float, y_m: float, reach_m: float = 0.35) -> int:
    """Return how many points of a map lie around a place."""
    return int((np.hypot(*(points_m - (x_m, y_m)).T) < reach_m).sum())


def test_a_cart_that_crosses_the_view_is_a_mover_and_not_in_the_map() -> None:
    """It comes out of nowhere onto ground that was seen: nothing of it stands, the box does.

    After a restart of the map it is still known that something moved.
    """
    mapper = SiteMapper(CLASSES)
    found = mapped(EMPTY + CROSSING, mapper)[-1]
    (mover,) = found.movers
    assert math.dist((mover.x_m, mover.y_m), (0.8, 0.65)) < 0.25
    assert math.hypot(mover.x_mps, mover.y_mps - 0.5) < 0.15
    assert near(found.obstacles_m, *BOX_M) >= 3
    assert near(found.obstacles_m, 0.8, 0.0, 0.6) == 0
    assert not [thing for thing in found.objects if thing.class_id == CART_ID]
    mapper.restart()
    (after,) = mapped([None], mapper)
    assert after.movers == ()
    assert after.moved_s == found.moved_s > 0.0


@pytest.mark.parametrize("box", [True, False])
def test_a_cart_that_comes_below_the_view_is_a_mover(*, box: bool) -> None:
    """Also where nothing else is in view, so that the view has no bases at all."""
    comes: Places = [(0.35 - 0.03 * step, 0.0) for step in range(20)]
    assert any(found.movers for found in mapped(EMPTY + comes, box=box))


def test_what_stood_and_moves_off_leaves_the_map() -> None:
    stands: Places = [(0.8, -0.6)] * 25
    maps = mapped(stands + [(0.8, -0.6 + 0.05 * step) for step in range(28)])
    assert near(maps[24].obstacles_m, 0.8, -0.6) >= 4
    assert not maps[24].movers
    assert not len(maps[24].lanes_m)
    assert len(maps[-1].movers) == 1
    assert near(maps[-1].obstacles_m, 0.8, -0.6) == 0


def test_where_something_moved_is_known_until_the_ground_there_is_seen_again() -> None:
    """It left the view at the side: beyond that nobody has looked, before it everything is seen."""
    leaves: Places = [(0.8, -0.4 + 0.05 * step) for step in range(36)]
    lane_m = mapped(EMPTY + leaves + [None] * 10)[-1].lanes_m
    assert len(lane_m)
    assert lane_m[:, 1].min() > 0.4
    assert np.abs(lane_m[:, 0] - 0.8).max() < 0.4


@pytest.mark.parametrize("moved", [True, False])
def test_what_has_arrived_and_waits_may_move_on(*, moved: bool) -> None:
    """Once anything has moved in a place, what stands on ground seen before is kept away from."""
    before = CROSSING + [None] * 30 if moved else [None] * 66
    found = mapped(EMPTY + before + [(1.7, 0.5)] * 20)[-1]
    assert not found.movers
    assert (near(found.lanes_m, 1.7, 0.5) >= 4) == moved


def test_nothing_is_judged_to_move_from_low_down() -> None:
    """A decimetre that the height is off there lets what stands slide."""
    assert not any(found.movers for found in mapped(EMPTY + CROSSING, height_m=0.9))


def landmarks(x_m: float, *, seen_s: float) -> Landmarks:
    """Return one base at a place, settled when it was seen."""
    time_s = np.array([seen_s])
    return replace(points((x_m, 0.0)), first_s=time_s, seen_s=time_s, settled_s=time_s)


@pytest.mark.parametrize(
    ("off_m", "on_ground", "owned", "arrived"),
    [
        (0.05, True, False, False),
        (0.05, True, True, False),  # a mover that passes a box does not take its points along
        (0.2, True, False, True),
        (0.125, True, False, False),
        (0.125, True, True, True),  # between both, the mover owns more
        (0.2, False, False, False),
    ],
)
def test_a_point_near_a_standing_one_has_not_arrived(
    *, off_m: float, on_ground: bool, owned: bool, arrived: bool
) -> None:
    seen, known = landmarks(1.0 + off_m, seen_s=20.0), landmarks(1.0, seen_s=0.0)
    found = find_arrivals(seen, known, np.array([on_ground]), np.array([owned]))
    assert found.tolist() == [arrived]


HERE = Pose2D(x_m=1.0, y_m=-0.5, yaw_rad=math.radians(90))


def hidden(
    *bearings_deg: float,
    unseen: tuple[float, float] | None = None,
    known: tuple[tuple[float, float], ...] = (),
) -> NDArray[np.float64] | None:
    """Return the arrival that hides ground 1.3 m away on bearings.

    All ground but one place was seen; places are metres ahead of `HERE` and to its right.
    """
    bearings, grid = np.radians(bearings_deg), GroundGrid()
    grid.seen_s[:] = 1.0
    if unseen is not None:
        row, column = HERE.to_world(*unseen)
        grid.seen_s[round(row / 0.1) + 120, round(column / 0.1) + 120] = -np.inf
    known_m = np.array([HERE.to_world(*place) for place in known]).reshape(-1, 2)
    ends_m = 1.3 * np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)
    return hidden_arrival(ends_m, HERE, grid, known_m)


def test_what_covers_ground_that_was_free_has_arrived() -> None:
    """The direction is that of the middle bearing, in the map's frame."""
    turned_rad = math.radians(90 + 30)
    expected = [math.cos(turned_rad), math.sin(turned_rad)]
    assert hidden(29, 30, 31) == pytest.approx(np.array(expected), abs=1e-6)
    for bearings_deg in ((), (30,), (30, 31)):  # specks
        assert hidden(*bearings_deg) is None


@pytest.mark.parametrize(("ahead_m", "arrived"), [(0.5, False), (1.0, False), (1.3, True)])
def test_on_ground_that_was_never_seen_an_obstacle_may_always_have_stood(
    *, ahead_m: float, arrived: bool
) -> None:
    """Farther ground need not have been seen."""
    assert (hidden(-1, 0, 1, unseen=(ahead_m, 0.0)) is not None) == arrived


@pytest.mark.parametrize("place", [(0.6, 0.0), (1.3, 0.2), (0.9, -0.25)])
def test_an_obstacle_of_the_map_is_known(place: tuple[float, float]) -> None:
    """One elsewhere explains nothing."""
    assert hidden(-1, 0, 1, known=(place,)) is None
    assert hidden(-1, 0, 1, known=((0.6, 0.8), (-0.5, 0.0))) is not None
