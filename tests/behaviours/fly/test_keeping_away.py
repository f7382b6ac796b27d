"""Keeping away: steps and pushes away from near obstacles, and never over the edge."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from behaviours.fly.keeping_away import (
    KeepAwayConfig,
    by_the_map,
    push_away_mps,
    step_away_m,
)
from uav_bt.testing.world import drawn_map
from uav_bt.types import MapObject, NearObstacles

CONFIG = KeepAwayConfig()
EDGE_M = 0.3


def around(
    *points: tuple[float, float], edges: list[tuple[float, float]] | None = None
) -> NearObstacles:
    return NearObstacles(
        points_m=np.array(points, dtype=float).reshape(-1, 2),
        edges_m=np.array(edges or [], dtype=float).reshape(-1, 2),
        captured_s=0.0,
    )


def test_the_step_leads_away_from_the_nearest_obstacle() -> None:
    step_m = step_away_m(around((0.0, 0.3), (2.0, 0.0)), CONFIG, EDGE_M)
    assert step_m == pytest.approx((0.0, -CONFIG.room_step_m))


@pytest.mark.parametrize("obstacles", [None, around(), around((0.5, 0.0))])
def test_nothing_near_needs_no_step(obstacles: NearObstacles | None) -> None:
    assert step_away_m(obstacles, CONFIG, EDGE_M) is None


def test_the_step_does_not_lead_to_another_obstacle() -> None:
    assert step_away_m(around((0.0, 0.3), (0.0, -0.4)), CONFIG, EDGE_M) is None


def test_the_step_does_not_lead_to_the_edge() -> None:
    """Between a box and the edge the drone stays rather than leave the ground."""
    assert step_away_m(around((0.0, 0.3), edges=[(0.0, -0.4)]), CONFIG, EDGE_M) is None
    assert step_away_m(around((0.0, 0.3), edges=[(0.0, -0.6)]), CONFIG, EDGE_M) is not None
    # The step is 0.15 m long and ends 0.45 m before that edge.
    assert step_away_m(around((0.0, 0.3), edges=[(0.0, -0.6)]), CONFIG, 0.5) is None


def test_between_an_obstacle_and_the_edge_the_push_is_from_the_nearer() -> None:
    forward_mps, right_mps = push_away_mps(around((0.0, 0.4), edges=[(0.0, -1.0)]), CONFIG)
    assert math.isclose(forward_mps, 0.0, abs_tol=1e-9)
    assert right_mps == pytest.approx(-CONFIG.keep_away_per_s * (CONFIG.keep_away_m - 0.4))
    assert push_away_mps(around((0.0, 1.0)), CONFIG) == (0.0, 0.0)


def test_the_push_grows_with_the_intrusion_up_to_a_limit() -> None:
    pushes_mps = [-push_away_mps(around((0.0, at_m)), CONFIG)[1] for at_m in (0.44, 0.35, 0.2)]
    assert pushes_mps == sorted(pushes_mps)
    assert 0.0 < pushes_mps[0] < pushes_mps[1] < pushes_mps[2]
    assert pushes_mps[2] == pytest.approx(CONFIG.keep_away_mps)


def test_what_the_map_has_is_kept_away_from_where_the_map_has_it() -> None:
    """It is remembered on the left, where it has drifted to; the map knows it on the right."""
    site_map = drawn_map(obstacles=np.array([(0.0, 0.3), (0.0, 0.35), (0.05, 0.3)]))
    remembered = around((0.0, 0.1), (0.02, 0.1), (0.0, 0.12))
    found = by_the_map(remembered, site_map, CONFIG)
    assert found is not None
    assert found.nearest_m == pytest.approx(0.3)
    assert push_away_mps(found, CONFIG)[1] < 0.0


def test_what_is_not_on_the_map_is_kept_away_from_where_it_was_seen() -> None:
    seen = around((0.0, -0.3), (0.0, -0.32), (0.02, -0.3))
    found = by_the_map(seen, drawn_map(), CONFIG)
    assert found is not None
    assert found.nearest_m == pytest.approx(0.3)


def test_a_map_that_views_contradict_is_not_used() -> None:
    seen, site_map = around((0.0, 0.1)), drawn_map(obstacles=np.array([(0.0, 0.3)]))
    assert by_the_map(seen, replace(site_map, contradicted_s=0.5), CONFIG) is seen
    assert by_the_map(seen, None, CONFIG) is seen
    assert by_the_map(None, site_map, CONFIG) is None


def test_the_sides_of_an_object_that_were_never_seen_push_too() -> None:
    """A box of 0.4 m whose far side was seen, and a wall as near on the other hand."""
    box = MapObject(class_id=4, x_m=0.0, y_m=0.5, size_m=0.4, width_m=0.4, std_m=0.1, seen_s=1.0)
    far_side = np.array([(x_m, 0.7) for x_m in np.arange(-0.2, 0.25, 0.1)])
    wall = np.array([(x_m, -0.4) for x_m in np.arange(-0.2, 0.25, 0.1)])
    known = replace(drawn_map(obstacles=np.vstack([far_side, wall])), objects=(box,))
    near = by_the_map(NearObstacles(points_m=np.empty((0, 2)), captured_s=1.0), known, CONFIG)
    _, right_mps = push_away_mps(near, CONFIG)
    assert right_mps < -0.05  # away from the box's near side, 0.3 m to the right
