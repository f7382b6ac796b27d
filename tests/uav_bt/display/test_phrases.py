"""Descriptions of flights, commands and fixes."""

import math
from dataclasses import replace
from typing import Any

import pytest

from tests.uav_bt.display.display_world import flight_report
from tests.worlds.values import corridor
from uav_bt.display.phrases import (
    describe_corridor,
    describe_fix,
    describe_flight,
    describe_free,
    describe_movement,
    lands_on_mark,
)
from uav_bt.lab.shipped import default_mark
from uav_bt.types import (
    CutMotors,
    Hover,
    Land,
    LandingMark,
    MarkFix,
    MoveBy,
    Movement,
    Release,
    TakeOff,
    Velocity,
)


@pytest.mark.parametrize(
    ("scene", "words"), [("val-a", "land_only in val-a, seed 3"), (None, "land_only with anafi")]
)
def test_a_flight_is_called_by_its_mission_and_its_place(scene: str | None, words: str) -> None:
    assert describe_flight("land_only.xml", scene=scene, drone="anafi", seed=3) == words


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
    searched_s: float | None, error_m: float | None, mark: LandingMark, *, on_it: bool
) -> None:
    report = replace(flight_report(), time_to_find_mark_s=searched_s, landing_error_m=error_m)
    assert lands_on_mark(report, mark) == on_it


@pytest.mark.parametrize(
    ("movement", "words"),
    [
        (TakeOff(), "take off"),
        (Land(), "land"),
        (Hover(), "hover"),
        (CutMotors(), "cut the motors"),
        (Release(), "released to the pilot"),
        (MoveBy(id=1, forward_m=0.3, down_m=-0.1), "move 0.30 m forward, 0.10 m up"),
        (MoveBy(id=2, yaw_rad=math.radians(-30)), "turn 30 deg left"),
        (MoveBy(id=3), "hold"),
        (
            Velocity(forward_mps=-0.4, right_mps=0.001, yaw_rate_radps=math.radians(20)),
            "fly 0.40 m/s back, turn 20 deg/s right",
        ),
    ],
)
def test_a_movement_in_words(movement: Movement, words: str) -> None:
    assert describe_movement(movement) == words


@pytest.mark.parametrize(
    ("place", "age_s", "words"),
    [
        ({"forward_m": 1.0, "right_m": -1.0, "detected": True}, 0.1, "1.41 m, 45 deg left, seen"),
        (
            {"forward_m": 2.0, "right_m": 0.0, "detected": False},
            1.26,
            "2.00 m, 0 deg right, carried 1.3 s",
        ),
        (None, math.inf, "none"),
        (None, 18.2, "none for 18 s"),
    ],
)
def test_a_fix_says_where_and_whether_it_is_seen(
    place: dict[str, Any] | None, age_s: float, words: str
) -> None:
    fix = None if place is None else MarkFix(captured_s=0.0, height_m=0.4, **place)
    assert describe_fix(fix, age_s) == words


def test_a_corridor_says_what_intrudes_and_how_far_the_way_is_free() -> None:
    clear = corridor()
    assert (describe_corridor(clear), describe_free(clear)) == ("corridor clear", "nothing ahead")
    blocked = replace(
        clear, free_distance_m=1.5, nearest_m=0.62, nearest_side="left", time_to_impact_s=2.04
    )
    assert describe_corridor(blocked) == "intrusion left, 0.62 m"
    assert describe_free(blocked) == "free 1.50 m ahead, impact in 2.0 s"
