"""Descriptions of flights, commands, fixes and corridors."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from tests.uav_bt.display.display_world import flight_report
from tests.worlds import values
from uav_bt import types
from uav_bt.display import phrases
from uav_bt.lab.shipped import default_mark

WIDE = replace(default_mark(), length_m=1.2, width_m=1.6)  # half its diagonal is 1 m


@pytest.mark.parametrize(
    ("searched_s", "error_m", "mark", "on_it"),
    [
        (5.6, 1.2, default_mark(), True),
        (None, 0.03, default_mark(), True),
        (None, 0.9, default_mark(), False),
        (None, 0.9, WIDE, True),
        (None, None, default_mark(), False),
    ],
    ids=["beside the pad that it looked for", "on it", "elsewhere", "on a wide one", "flying"],
)
def test_a_landing_is_held_against_the_mark_where_the_mission_is_about_it(
    searched_s: float | None, error_m: float | None, mark: types.LandingMark, *, on_it: bool
) -> None:
    report = replace(flight_report(), time_to_find_mark_s=searched_s, landing_error_m=error_m)
    assert phrases.lands_on_mark(report, mark) == on_it


def flight(scene: str | None) -> str:
    return phrases.describe_flight("land_only.xml", scene=scene, drone="anafi", seed=3)


def fix(forward_m: float, right_m: float, *, detected: bool) -> types.MarkFix:
    place = {"forward_m": forward_m, "right_m": right_m, "height_m": 0.4}
    return types.MarkFix(captured_s=0.0, detected=detected, **place)


BACK = types.Velocity(forward_mps=-0.4, right_mps=0.001, yaw_rate_radps=math.radians(20))
BLOCKED = values.corridor(1.5, "left", nearest_m=0.62, impact_s=2.04)


MOVES = {
    types.TakeOff(): "take off",
    types.Land(): "land",
    types.Hover(): "hover",
    types.CutMotors(): "cut the motors",
    types.Release(): "released to the pilot",
    types.MoveBy(id=1, forward_m=0.3, down_m=-0.1): "move 0.30 m forward, 0.10 m up",
    types.MoveBy(id=2, yaw_rad=math.radians(-30)): "turn 30 deg left",
    types.MoveBy(id=3): "hold",
    BACK: "fly 0.40 m/s back, turn 20 deg/s right",
}
CARRIED = "2.00 m, 0 deg right, carried 1.3 s"


@pytest.mark.parametrize(
    ("describe", "given", "words"),
    [
        (flight, ["val-a"], "land_only in val-a, seed 3"),
        (flight, [None], "land_only with anafi"),
        *((phrases.describe_movement, [move], words) for move, words in MOVES.items()),
        (phrases.describe_fix, [fix(1, -1, detected=True), 0.1], "1.41 m, 45 deg left, seen"),
        (phrases.describe_fix, [fix(2, 0, detected=False), 1.26], CARRIED),
        (phrases.describe_fix, [None, math.inf], "none"),
        (phrases.describe_fix, [None, 18.2], "none for 18 s"),
        (phrases.describe_corridor, [values.corridor()], "corridor clear"),
        (phrases.describe_corridor, [BLOCKED], "intrusion left, 0.62 m"),
        (phrases.describe_free, [values.corridor()], "nothing ahead"),
        (phrases.describe_free, [BLOCKED], "free 1.50 m ahead, impact in 2.0 s"),
    ],
)
def test_what_is_shown_has_words(
    describe: Callable[..., str], given: list[Any], words: str
) -> None:
    assert describe(*given) == words
