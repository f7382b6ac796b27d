"""The corridor rule on ray-cast class maps and corridors of known reach."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.policies.corridor_rule import (
    GROUND_END_M,
    TURN_RAD,
    CorridorRule,
    ground_reach,
)
from tests.behaviours.policies.cast_world import cast, view
from tests.worlds.leaves import map_with
from tests.worlds.values import corridor
from uav_bt.answers import Advance, Blocked
from uav_bt.lab.classes import GROUND, OUTSIDE
from uav_bt.types import Corridor, NearObstacles


def decide(found: Corridor | None = None, ids: Any = None, **seen: Any) -> Advance | Blocked:
    shown = cast() if ids is None else ids
    return CorridorRule().decide(view(shown, corridor=found or corridor(), **seen))


@pytest.mark.parametrize(
    ("free_m", "step_m"),
    [(2.5, 1.0), (1.6, 1.0), (1.3, 0.7), (0.95, 0.35), (0.89, None), (0.5, None), (0.0, None)],
)
def test_the_step_ends_the_margin_before_an_obstacle_ahead(
    free_m: float, step_m: float | None
) -> None:
    decision = decide(corridor(free_m, "front"))
    if isinstance(decision, Advance):
        assert decision.forward_m == pytest.approx(step_m)
        assert (decision.yaw_rad, decision.reason) == (0.0, "clear")
    else:
        assert step_m is None
        assert (decision.reason, decision.ground_ends) == ("obstacle", False)


def test_the_step_ends_the_edges_margin_before_the_end_of_the_ground() -> None:
    """From the body's centre, 0.15 m behind the lens."""
    decision = decide(ids=cast(ground_m=1.3))
    assert isinstance(decision, Advance)
    assert decision.forward_m == pytest.approx(1.3 + 0.15 - GROUND_END_M, abs=0.06)


def test_remembered_obstacles_shorten_or_forbid_the_step() -> None:
    beside = NearObstacles(points_m=np.array([(1.0, 0.4)]), captured_s=0.0)
    decision = decide(site_map=map_with(beside))
    assert isinstance(decision, Advance)
    assert 0.3 <= decision.forward_m <= 1.0 - math.sqrt(0.55**2 - 0.4**2) + 1e-9
    unplaced = NearObstacles(captured_s=0.0, unplaced_rad=np.radians([3.0, 4.0]))
    assert isinstance(decide(site_map=map_with(unplaced)), Blocked)


def test_the_turn_leads_away_from_the_intrusion() -> None:
    for side, box, sign in (
        ("left", None, 1),  # away from the side that is intruded upon, as in the paper
        ("right", None, -1),
        ("front", (1.2, -0.9, 0.1), 1),  # to the half with fewer obstacle pixels
        ("front", (1.2, -0.1, 0.9), -1),
    ):
        found, ids = corridor(0.5, side), cast([] if box is None else [box])
        assert decide(found, ids).yaw_rad == pytest.approx(sign * TURN_RAD)
        for turning in (1, -1):  # a turn under way keeps its direction
            assert decide(found, ids, turning=turning).yaw_rad == pytest.approx(turning * TURN_RAD)


@pytest.mark.parametrize(("slant", "sign"), [(0.6, -1), (-0.6, 1)])
def test_the_edge_is_turned_along(slant: float, sign: int) -> None:
    decision = decide(ids=cast(ground_m=1.2, slant=slant))
    assert isinstance(decision, Blocked)
    assert (decision.reason, decision.ground_ends) == ("edge", True)
    assert decision.yaw_rad == pytest.approx(sign * TURN_RAD)
    corner = decide(corridor(0.4, "front"), cast(ground_m=0.0))
    assert isinstance(corner, Blocked)
    assert (corner.reason, corner.ground_ends) == ("corner", True)


def test_without_depth_the_drone_looks_round() -> None:
    decision = CorridorRule().decide(view(cast(), tie_break=0.1))
    assert isinstance(decision, Blocked)
    assert decision.reason == "no depth"
    assert decision.yaw_rad == pytest.approx(-TURN_RAD)


def test_a_turn_asks_for_more_room_and_full_turns_for_less_up_to_a_limit() -> None:
    for free_m, seen, advances in (
        (0.95, {}, True),
        (0.95, {"turning": 1}, False),  # no dithering at the threshold
        (0.8, {"full_turns": 2}, False),
        (0.8, {"full_turns": 3}, True),
        (0.7, {"full_turns": 50}, False),
    ):
        assert isinstance(decide(corridor(free_m, "front"), **seen), Advance) == advances


@pytest.mark.parametrize("ground_m", [1.4, 2.0, 3.1, math.inf])
def test_the_reach_is_where_the_ground_ends(ground_m: float) -> None:
    """To a step of the scan and a row of the image. Ground goes on behind a box."""
    seen = view(cast([(1.5, -3.0, 3.0)]) if math.isinf(ground_m) else cast(ground_m=ground_m))
    assert ground_reach(seen.class_map.roles, seen) == pytest.approx(ground_m, abs=0.1)


def test_a_high_or_level_camera_sees_the_floor_several_metres_away() -> None:
    for pitch_deg, height_m, role, reach_m in (
        (0, 1.8, OUTSIDE, 0.0),
        (-10, 2.4, OUTSIDE, 0.0),
        (-30, 1.5, OUTSIDE, 0.0),
        (30, 1.5, OUTSIDE, 0.0),
        (0, 1.8, GROUND, math.inf),  # further away than the range of the rule,
    ):
        pitch_rad = math.radians(pitch_deg)
        seen = replace(view(cast()), gimbal_pitch_rad=pitch_rad, height_above_ground_m=height_m)
        assert ground_reach(np.full_like(seen.class_map.roles, role), seen) == reach_m


@given(st.floats(0.0, 5.0), st.integers(0, 9), st.sampled_from([-1, 0, 1]), st.floats(0.0, 5.0))
def test_a_step_never_reaches_an_obstacle(
    free_m: float, full_turns: int, turning: int, ground_m: float
) -> None:
    """Whatever the relief: half a body's length and a little remain."""
    ids = cast(ground_m=ground_m)
    said = decide(corridor(free_m, "front"), ids, full_turns=full_turns, turning=turning)
    if isinstance(said, Advance):
        assert said.forward_m <= max(free_m - 0.4, 0.0) + 1e-9
    assert isinstance(said, Advance) == (said.yaw_rad == 0.0)
