"""The corridor rule on ray-cast class maps and corridors of known reach."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.policies.corridor_rule import CorridorRule, CorridorRuleConfig, ground_reach
from tests.behaviours.policies.cast_world import CAMERA, cast, view
from tests.worlds.leaves import map_with
from tests.worlds.values import corridor
from uav_bt.answers import Advance, Blocked
from uav_bt.errors import ValueRangeError
from uav_bt.lab.classes import GROUND, OUTSIDE
from uav_bt.types import Corridor, NearObstacles

# Fixed here, so that tuning the defaults does not change what these tests ask.
CONFIG = CorridorRuleConfig(
    longest_step_m=1.0,
    shortest_step_m=0.3,
    turn_rad=math.radians(30),
    front_margin_m=0.6,
    edge_margin_m=0.7,
    ground_half_width_m=0.4,
    ground_share=0.7,
    ground_range_m=4.0,
    side_margin_m=0.55,
    margin_relief_m=0.06,
    max_full_turns=3,
    hysteresis_m=0.15,
    tie_ratio=0.1,
)
RULE = CorridorRule(CONFIG)


def decide(found: Corridor | None = None, ids: Any = None, **seen: Any) -> Advance | Blocked:
    shown = cast() if ids is None else ids
    return RULE.decide(view(shown, corridor=found or corridor(), **seen))


def points(*places: tuple[float, float]) -> NearObstacles:
    return NearObstacles(points_m=np.array(places, dtype=float), captured_s=0.0)


# --- how far --------------------------------------------------------------------------------------


def test_a_clear_front_is_advanced_a_metre() -> None:
    """Nothing within the corridor: the longest step, no turn."""
    decision = decide(corridor(2.5))

    assert isinstance(decision, Advance)
    assert (decision.forward_m, decision.yaw_rad, decision.reason) == (1.0, 0.0, "clear")


@pytest.mark.parametrize(("free_m", "step_m"), [(1.6, 1.0), (1.3, 0.7), (0.95, 0.35)])
def test_something_ahead_shortens_the_step(free_m: float, step_m: float) -> None:
    """The step ends the margin before it."""
    decision = decide(corridor(free_m, "front"))

    assert isinstance(decision, Advance)
    assert decision.forward_m == pytest.approx(step_m)


@pytest.mark.parametrize("free_m", [0.0, 0.5, 0.89])
def test_too_little_room_is_no_step(free_m: float) -> None:
    """Less than the shortest step before the margin: a turn."""
    decision = decide(corridor(free_m, "left"))

    assert isinstance(decision, Blocked)
    assert decision.reason == "obstacle"
    assert not decision.ground_ends


def test_the_grounds_end_shortens_the_step() -> None:
    """The step ends the edge's margin before it, from the body's centre."""
    decision = decide(ids=cast(ground_m=1.45))

    assert isinstance(decision, Advance)
    assert decision.forward_m == pytest.approx(1.45 + 0.15 - 0.7, abs=0.06)


def test_remembered_obstacles_shorten_the_step() -> None:
    """What stands beside the way was seen earlier: the step stops before passing it."""
    decision = decide(site_map=map_with(points((1.0, 0.4))))

    assert isinstance(decision, Advance)
    assert 0.3 <= decision.forward_m <= 1.0 - math.sqrt(0.55**2 - 0.4**2) + 1e-9


def test_an_obstacle_of_unknown_range_forbids_the_step() -> None:
    """Bearings near to ahead without a known base."""
    unplaced = NearObstacles(
        points_m=np.empty((0, 2)), captured_s=0.0, unplaced_rad=np.radians([3.0, 4.0])
    )

    assert isinstance(decide(site_map=map_with(unplaced)), Blocked)


# --- which way ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("side", "sign"), [("left", 1), ("right", -1)])
def test_it_turns_away_from_the_side_intruded_upon(
    side: Literal["left", "right"], sign: int
) -> None:
    """As the paper has it: an intrusion on the right turns left."""
    assert decide(corridor(0.5, side)).yaw_rad == pytest.approx(sign * CONFIG.turn_rad)


@pytest.mark.parametrize(("left_m", "right_m", "sign"), [(-0.9, 0.1, 1), (-0.1, 0.9, -1)])
def test_a_front_intrusion_is_turned_away_from_by_the_view(
    left_m: float, right_m: float, sign: int
) -> None:
    """Dead ahead, the half with fewer obstacle pixels is the way."""
    decision = decide(corridor(0.5, "front"), cast([(1.2, left_m, right_m)]))

    assert decision.yaw_rad == pytest.approx(sign * CONFIG.turn_rad)


@pytest.mark.parametrize(("slant", "sign"), [(0.6, -1), (-0.6, 1)])
def test_the_edge_is_turned_along(slant: float, sign: int) -> None:
    """Where the ground ends aslant, the turn goes to where more of it lies."""
    decision = decide(ids=cast(ground_m=1.2, slant=slant))

    assert isinstance(decision, Blocked)
    assert (decision.reason, decision.ground_ends) == ("edge", True)
    assert decision.yaw_rad == pytest.approx(sign * CONFIG.turn_rad)


def test_a_corner_is_named() -> None:
    """An intrusion and the ground's end."""
    decision = decide(corridor(0.4, "front"), cast(ground_m=0.0))

    assert isinstance(decision, Blocked)
    assert (decision.reason, decision.ground_ends) == ("corner", True)


@pytest.mark.parametrize("turning", [-1, 1])
def test_a_turn_keeps_its_direction(turning: int) -> None:
    """Whatever side the intrusion is on by now."""
    decision = decide(corridor(0.4, "left"), turning=turning)

    assert decision.yaw_rad == pytest.approx(turning * CONFIG.turn_rad)


def test_without_depth_it_stops_and_looks_round() -> None:
    """Without a corridor the drone does not advance."""
    decision = RULE.decide(view(cast(), tie_break=0.1))

    assert decision.reason == "no depth"
    assert isinstance(decision, Blocked)
    assert decision.yaw_rad == pytest.approx(-CONFIG.turn_rad)


def test_leaving_a_turn_takes_more_room_than_a_step() -> None:
    """No dithering at the threshold."""
    found = corridor(0.95, "front")

    assert isinstance(decide(found), Advance)
    assert isinstance(decide(found, turning=1), Blocked)


def test_full_turns_ask_for_less() -> None:
    """So that it does not circle for ever; the relief has an end."""
    found = corridor(0.8, "front")

    assert isinstance(decide(found), Blocked)
    assert isinstance(decide(found, full_turns=2), Advance)
    assert isinstance(decide(corridor(0.7, "front"), full_turns=50), Blocked)


@given(
    free_m=st.floats(0.0, 5.0),
    full_turns=st.integers(0, 9),
    turning=st.sampled_from([-1, 0, 1]),
    ground_m=st.floats(0.0, 5.0),
)
def test_a_step_never_reaches_an_obstacle(
    free_m: float, full_turns: int, turning: int, ground_m: float
) -> None:
    """Whatever the relief: half a body's length and a little remain."""
    decision = decide(
        corridor(free_m, "front"),
        cast(ground_m=ground_m),
        full_turns=full_turns,
        turning=turning,
    )

    if isinstance(decision, Advance):
        assert decision.forward_m <= max(free_m - 0.4, 0.0) + 1e-9
        assert decision.yaw_rad == 0.0
    else:
        assert decision.yaw_rad != 0.0


# --- the ground's reach ---------------------------------------------------------------------------


@pytest.mark.parametrize("ground_m", [1.4, 2.0, 3.1])
def test_the_reach_is_where_the_ground_ends(ground_m: float) -> None:
    """To a step of the scan and a row of the image."""
    seen = view(cast(ground_m=ground_m))

    assert ground_reach(seen.class_map.roles, seen, CONFIG) == pytest.approx(ground_m, abs=0.1)


@pytest.mark.parametrize(("pitch_deg", "height_m"), [(0, 1.8), (-10, 2.4), (-30, 1.5), (30, 1.5)])
def test_where_no_ground_is_in_view_it_reaches_nowhere(pitch_deg: float, height_m: float) -> None:
    """The nearest floor in view is several metres away, or there is none."""
    pitch_rad = math.radians(pitch_deg)
    seen = replace(view(cast()), gimbal_pitch_rad=pitch_rad, height_above_ground_m=height_m)
    outside = np.full_like(seen.class_map.roles, OUTSIDE)
    assert ground_reach(outside, seen, CONFIG) == 0.0


def test_ground_farther_than_the_range_of_the_rule_is_flown_to() -> None:
    """A level camera shows the floor from several metres on."""
    seen = replace(view(cast()), gimbal_pitch_rad=0.0, height_above_ground_m=1.8)
    ground = np.full_like(seen.class_map.roles, GROUND)
    assert ground_reach(ground, seen, CONFIG) == math.inf


def test_boxes_stand_on_ground() -> None:
    """A box hides the ground behind it; the ground does not end there."""
    seen = view(cast([(1.5, -3.0, 3.0)], camera=CAMERA))

    assert ground_reach(seen.class_map.roles, seen, CONFIG) == math.inf


@pytest.mark.parametrize(
    "wrong", [{"shortest_step_m": 0.0}, {"longest_step_m": 0.1}, {"turn_rad": 0.0}]
)
def test_senseless_settings_are_refused(wrong: dict[str, float]) -> None:
    """Each is named."""
    with pytest.raises(ValueRangeError):
        CorridorRuleConfig(**wrong)
