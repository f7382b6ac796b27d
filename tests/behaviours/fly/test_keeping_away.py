"""Steps and pushes away from near obstacles, and never over the edge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from behaviours.fly.keeping_away import (
    KEEP_AWAY_M,
    PUSH_MPS,
    PUSH_PER_S,
    ROOM_STEP_M,
    by_the_map,
    push_away_mps,
    step_away_m,
)
from uav_bt.testing.world import drawn_map
from uav_bt.types import MapObject, NearObstacles

Points = list[tuple[float, float]]


def around(points: Points, edges: Points | None = None) -> NearObstacles:
    places_m = [np.array(each, dtype=float).reshape(-1, 2) for each in (points, edges or [])]
    return NearObstacles(points_m=places_m[0], edges_m=places_m[1], captured_s=0.0)


BESIDE: Points = [(0.0, 0.3)]


@pytest.mark.parametrize(
    ("obstacles", "edge_m", "step_m"),
    [
        (around([*BESIDE, (2.0, 0.0)]), 0.3, (0.0, -ROOM_STEP_M)),
        (None, 0.3, None),
        (around([]), 0.3, None),
        (around([(0.5, 0.0)]), 0.3, None),
        (around([*BESIDE, (0.0, -0.4)]), 0.3, None),  # to another obstacle
        # Between a box and the edge the drone stays rather than leave the ground.
        (around(BESIDE, [(0.0, -0.4)]), 0.3, None),
        (around(BESIDE, [(0.0, -0.6)]), 0.3, (0.0, -ROOM_STEP_M)),
        (around(BESIDE, [(0.0, -0.6)]), 0.5, None),  # it ends 0.45 m before that edge
    ],
)
def test_the_step_leads_away_from_the_nearest_obstacle(
    obstacles: NearObstacles | None, edge_m: float, step_m: tuple[float, float] | None
) -> None:
    found_m = step_away_m(obstacles, edge_m)
    assert found_m == (None if step_m is None else pytest.approx(step_m))


def test_the_push_grows_with_the_intrusion_up_to_a_limit() -> None:
    pushes_mps = [-push_away_mps(around([(0.0, at_m)]))[1] for at_m in (1.0, 0.44, 0.35, 0.2)]
    assert pushes_mps[0] == 0.0
    assert pushes_mps == sorted(set(pushes_mps))
    assert pushes_mps[-1] == pytest.approx(PUSH_MPS)
    _, right_mps = push_away_mps(around([(0.0, 0.4)], [(0.0, -1.0)]))
    assert right_mps == pytest.approx(-PUSH_PER_S * (KEEP_AWAY_M - 0.4))


def test_mapped_obstacles_are_kept_away_from_where_the_map_has_them() -> None:
    """Remembered on the left, where they have drifted to; the map knows them on the right."""
    site_map = drawn_map(obstacles=np.array([(0.0, 0.3), (0.0, 0.35), (0.05, 0.3)]))
    found = by_the_map(around([(0.0, 0.1), (0.02, 0.1), (0.0, 0.12)]), site_map)
    assert found is not None
    assert found.nearest_m == pytest.approx(0.3)
    assert push_away_mps(found)[1] < 0.0
    seen = by_the_map(around([(0.0, -0.3), (0.0, -0.32), (0.02, -0.3)]), drawn_map())
    assert seen is not None
    assert seen.nearest_m == pytest.approx(0.3)


def test_a_map_that_views_contradict_is_not_used() -> None:
    seen, site_map = around([(0.0, 0.1)]), drawn_map(obstacles=np.array([(0.0, 0.3)]))
    assert by_the_map(seen, replace(site_map, contradicted_s=0.5)) is seen
    assert by_the_map(seen, None) is seen
    assert by_the_map(None, site_map) is None


def test_the_sides_of_an_object_that_were_never_seen_push_too() -> None:
    """A box of 0.4 m whose far side was seen, and a wall as near on the other hand."""
    box = MapObject(class_id=4, x_m=0.0, y_m=0.5, size_m=0.4, width_m=0.4, std_m=0.1, seen_s=1.0)
    x_m = np.arange(-0.2, 0.25, 0.1)
    sides_m = np.vstack([np.column_stack([x_m, np.full(len(x_m), at_m)]) for at_m in (0.7, -0.4)])
    known = replace(drawn_map(obstacles=sides_m), objects=(box,))
    near = by_the_map(around([]), known)
    assert push_away_mps(near)[1] < -0.05  # away from the box's near side, 0.3 m to the right
