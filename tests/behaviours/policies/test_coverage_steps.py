"""The control student's teacher: as far as the map leaves room ahead, else a turn."""

from __future__ import annotations

import numpy as np
import pytest

from behaviours.policies.coverage_steps import CoverageSteps
from tests.behaviours.path.test_survey import drawn_map, where
from tests.behaviours.policies.cast_world import cast, view
from uav_bt.errors import MissionError
from uav_bt.protocols import Decision
from uav_bt.types.site_map import SiteMap


def decide(site_map: SiteMap | None, **seen: object) -> Decision:
    return CoverageSteps().decide(view(cast(), site_map=site_map, **seen))


def wall(ahead_m: float) -> np.ndarray:
    """Return a wall across the way of who looks along x from the origin."""
    return np.column_stack([np.full(90, ahead_m), np.arange(-2.2, 2.3, 0.05)])


def test_without_a_map_it_says_which_leaf_makes_one() -> None:
    with pytest.raises(MissionError, match="<RememberObstacles/>"):
        decide(None)


def test_over_open_ground_it_advances_by_the_longest_step() -> None:
    decision = decide(drawn_map())
    assert decision.forward_m == pytest.approx(1.0)
    assert decision.speed_mps is None
    assert decision.free_m == pytest.approx(1.0)


@pytest.mark.parametrize("ahead_m", [0.9, 1.0, 1.2])
def test_a_step_ends_before_what_stands_ahead(ahead_m: float) -> None:
    decision = decide(drawn_map(obstacles=wall(ahead_m)))
    assert decision.forward_m == pytest.approx(ahead_m - 0.45, abs=0.1)
    assert decision.free_m == pytest.approx(decision.forward_m, abs=0.1)


def test_what_stands_beside_the_way_and_out_of_view_shortens_the_step() -> None:
    beside = np.array([[0.8, 0.3], [0.8, 0.35], [0.85, 0.3]])
    assert decide(drawn_map(obstacles=beside)).forward_m < 0.6


def test_an_obstacle_right_ahead_is_turned_from() -> None:
    decision = decide(drawn_map(obstacles=wall(0.6)))
    assert decision.blocked
    assert not decision.carpet_ends
    assert decision.free_m is not None
    assert decision.free_m < 0.3


def test_the_edge_is_turned_from_however_free_of_obstacles_the_way_is() -> None:
    decision = decide(drawn_map(pose=(1.5, 0.0, 0.0)))
    assert decision.blocked
    assert decision.carpet_ends
    assert decision.free_m == pytest.approx(1.0)


@pytest.mark.parametrize("side", ["left", "right"])
def test_it_turns_to_where_coverage_would_fly(side: str) -> None:
    other = {"left": "right", "right": "left"}[side]
    from_m = 1.0 if side == "left" else -1.0
    decision = decide(drawn_map(passed=where(other), pose=(1.6, from_m, 0.0)))
    assert decision.blocked
    assert (decision.yaw_rad < 0.0) == (side == "left")


def test_a_turn_under_way_keeps_its_direction() -> None:
    edge = drawn_map(passed=where("right"), pose=(1.6, 0.0, 0.0))
    assert decide(edge, turning=1).yaw_rad > 0.0
    assert decide(edge, turning=-1).yaw_rad < 0.0


def test_leaving_a_turn_takes_more_room_than_a_step() -> None:
    narrow = drawn_map(obstacles=wall(0.85))
    assert not decide(narrow).blocked
    assert decide(narrow, turning=1).blocked


def test_full_turns_without_a_way_relieve_the_margins() -> None:
    lane = np.vstack([[[x, y] for x in np.arange(-2, 2, 0.05)] for y in (-0.42, 0.42)])
    narrow = drawn_map(obstacles=lane)
    assert not decide(narrow, full_turns=3).blocked
