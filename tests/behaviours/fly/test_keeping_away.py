"""Steps and pushes away from near obstacles, and never over the edge."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from behaviours.fly.keeping_away import by_the_map, push_away_mps, step_away_m
from uav_bt.testing.world import drawn_map
from uav_bt.types import MapObject, NearObstacles

Points = Sequence[tuple[float, float]]


def around(points: Points, edges: Points = ()) -> NearObstacles:
    points_m, edges_m = (np.array(each, dtype=float).reshape(-1, 2) for each in (points, edges))
    return NearObstacles(points_m=points_m, edges_m=edges_m, captured_s=0.0)


BESIDE: Points = [(0.0, 0.3)]


@pytest.mark.parametrize(
    ("obstacles", "edge_m", "step_m"),
    [
        (around([*BESIDE, (2.0, 0.0)]), 0.3, (0.0, -0.15)),
        (None, 0.3, None),
        (around([]), 0.3, None),
        (around([(0.5, 0.0)]), 0.3, None),
        (around([*BESIDE, (0.0, -0.4)]), 0.3, None),  # to another obstacle
        # Between a box and the edge the drone stays rather than leave the ground.
        (around(BESIDE, [(0.0, -0.4)]), 0.3, None),
        (around(BESIDE, [(0.0, -0.6)]), 0.3, (0.0, -0.15)),
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
    assert pushes_mps[-1] == pytest.approx(0.2)
    _, right_mps = push_away_mps(around([(0.0, 0.4)], [(0.0, -1.0)]))
    assert right_mps == pytest.approx(-0.075)


def test_mapped_obstacles_are_kept_away_from_where_the_map_has_them() -> None:
    """Remembered on the left, where they have drifted to; the map knows them on the right.

    A map that views contradict is not used.
    """
    site_map = drawn_map(obstacles=np.array([(0.0, 0.3), (0.0, 0.35), (0.05, 0.3)]))
    seen = around([(0.0, 0.1), (0.02, 0.1), (0.0, 0.12)])
    found = by_the_map(seen, site_map)
    assert found is not None
    assert found.nearest_m == pytest.approx(0.3)
    assert push_away_mps(found)[1] < 0.0
    unmapped = by_the_map(around([(0.0, -0.3), (0.0, -0.32), (0.02, -0.3)]), drawn_map())
    assert unmapped is not None
    assert unmapped.nearest_m == pytest.approx(0.3)
    assert by_the_map(seen, replace(site_map, contradicted_s=0.5)) is seen
    assert by_the_map(seen, None) is seen
    assert by_the_map(None, site_map) is None


def test_in_a_gap_what_was_seen_lately_comes_before_the_map() -> None:
    """A single point apart from others is none."""
    mapped_m = np.array([(0.0, 0.3), (0.0, 0.35), (0.05, 0.3), (0.0, -0.42)])
    seen = around([(0.0, 0.36), (0.02, 0.36), (0.05, 0.36), (0.0, 0.2)])
    found = by_the_map(seen, replace(drawn_map(obstacles=mapped_m), near=seen), in_gap=True)
    assert found is not None
    assert sorted(found.points_m[:, 1]) == pytest.approx([-0.42, 0.36, 0.36, 0.36])


def test_in_a_gap_the_push_leads_to_its_middle() -> None:
    """However many points are on a side: fewer than three are none."""
    left_m, right_m = ([(0.05 * i, y_m) for i in range(3)] for y_m in (-0.25, 0.35))
    both = around([*left_m, *left_m, *right_m])
    assert push_away_mps(both, in_gap=True)[1] == pytest.approx(1.2 * 0.05)
    one = around([*left_m, *right_m[1:]])
    assert push_away_mps(one, in_gap=True)[1] == pytest.approx(0.1, abs=0.05)


def test_the_sides_of_an_object_that_were_never_seen_push_too() -> None:
    box = MapObject(class_id=4, x_m=0.0, y_m=0.5, size_m=0.4, width_m=0.4, std_m=0.1, seen_s=1.0)
    x_m = np.arange(-0.2, 0.25, 0.1)
    sides_m = np.vstack([np.column_stack([x_m, np.full(len(x_m), at_m)]) for at_m in (0.7, -0.4)])
    known = replace(drawn_map(obstacles=sides_m), objects=(box,))
    near = by_the_map(around([]), known)
    assert push_away_mps(near)[1] < -0.05  # away from the box's near side, 0.3 m to the right
