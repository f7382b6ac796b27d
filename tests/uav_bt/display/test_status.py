"""Words for flights, commands, fixes and corridors; the status line and the summary."""

import io
import math
import re
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from typing import Any

import pytest
from rich.console import Console

from tests.uav_bt.display.display_world import World, flight_report
from tests.worlds import values
from uav_bt import types
from uav_bt.clock import ManualClock
from uav_bt.display import phrases
from uav_bt.display.status import LiveStatus, StandardError, summary
from uav_bt.lab.shipped import default_mark
from uav_bt.mission.flight_report import FlightReport, Percentiles
from uav_bt.mission.safety import Override
from uav_bt.types import Pose
from uav_bt.types.flight_results import EventKind, FlightEvent

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
def test_what_is_shown_is_named(describe: Callable[..., str], given: list[Any], words: str) -> None:
    assert describe(*given) == words


# --- the status line and the summary --------------------------------------------------------------


def event(time_s: float, kind: EventKind, text: str) -> FlightEvent:
    return FlightEvent(time_s=time_s, kind=kind, text=text)


def watch(*, terminal: bool = False) -> tuple[World, LiveStatus, io.StringIO, ManualClock]:
    world, out, wall = World(), io.StringIO(), ManualClock(100.0)
    console = Console(file=out, force_terminal=terminal, width=120, color_system=None)
    return world, LiveStatus(world.board, console=console, wall_clock_s=wall.now), out, wall


def test_without_a_terminal_a_line_comes_every_ten_seconds_of_mission_time() -> None:
    world, status, out, wall = watch()
    for _ in range(251):
        status.on_tick(world.tick())
        wall.advance(0.01)
    status.close()
    times = [float(line.split()[1]) for line in out.getvalue().splitlines()]
    assert times == [0.0, 10.0, 20.0]


def test_a_line_holds_phase_pace_height_way_mark_and_the_running_leaf() -> None:
    world, status, _, wall = watch()
    world.see()
    status.on_tick(world.tick(pose=Pose(x_m=0.0, y_m=0.0, z_m=1.5, yaw_rad=0.0)))
    record = world.tick(pose=Pose(x_m=2.0, y_m=0.0, z_m=1.5, yaw_rad=0.0))
    status.on_tick(record)
    assert status.line(record, wall.now() + 0.02).plain == (
        "explore       0.1 s  5.0x  height 1.50 m  flown 2.0 m  mark 1.2 m  Explore: clear"
    )


@pytest.mark.parametrize(
    ("changes", "end"),
    [
        ({"override": Override.MANUAL}, "mark -  manual take-over"),
        ({"warnings": ("it drifts",)}, "Explore: clear  it drifts"),
    ],
    ids=["an override instead of the leaf", "a warning behind it"],
)
def test_a_line_ends_with_what_is_most_urgent(changes: dict[str, Any], end: str) -> None:
    world, status, _, wall = watch()
    record = replace(world.tick(), **changes)
    status.on_tick(record)
    assert status.line(record, wall.now()).plain.endswith(end)


def test_messages_of_leaves_are_shown_at_once_and_other_events_are_not() -> None:
    world, status, out, _ = watch()
    status.on_tick(world.tick())
    told = [(EventKind.WARNING, "low battery"), (EventKind.PHASE, "land")]
    told += [(EventKind.FAILED, "GoTo mark: no way"), (EventKind.EXPECTED, "Explore: edge")]
    status.on_tick(replace(world.tick(), events=tuple(event(1.25, *one) for one in told)))
    assert out.getvalue().splitlines()[1:] == [
        "1.2 s  warning: low battery",
        "1.2 s  failed: GoTo mark: no way",
    ]


@pytest.mark.parametrize(
    ("override", "act"),
    [
        (Override.STALE_FRAME, []),
        (Override.LINK, ["link lost: take the remote control"]),
        (Override.CUT, ["motors cut: keep clear, then take the remote control"]),
    ],
)
def test_an_override_is_shown_at_once_with_what_to_do(override: Override, act: list[str]) -> None:
    world, status, out, _ = watch()
    for each in (None, None, override, override, None, None):
        status.on_tick(world.tick(override=each))
    ends = [line.split("  ")[-1] for line in out.getvalue().splitlines()]
    assert ends == ["Explore: clear", *act, override.value, "Explore: clear"]


def test_on_a_terminal_the_line_is_redrawn_and_the_landing_takes_its_place() -> None:
    world, status, out, wall = watch(terminal=True)
    with closing(status):
        for _ in range(100):
            status.on_tick(world.tick())
            wall.advance(0.01)
        status.on_descent(None, "no link")
    text = out.getvalue()
    assert 4 <= text.count("height 1.50 m") <= 7, "five times in this second"
    assert "landing (not heard): no link" in text
    assert text.rindex("\x1b[?25h") > text.rindex("\x1b[?25l"), "the cursor comes back"


def test_a_drone_that_is_brought_down_is_shown_with_the_reason() -> None:
    world, status, out, wall = watch()
    state = world.tick().observation.state
    for _ in range(61):
        status.on_descent(state, "nothing heard for 10 s; take it over")
        wall.advance(0.1)
    words = f"landing ({state.flying.value}): nothing heard for 10 s; take it over"
    assert out.getvalue().splitlines() == [words] * 2
    status.on_descent(None, "lost")  # before the first telemetry


class Gone(io.StringIO):
    """A pipe without a reader."""

    def write(self, text: str) -> int:
        raise BrokenPipeError(text)


def test_a_reader_that_went_away_ends_the_display_and_not_the_program() -> None:
    world = World()
    status = LiveStatus(world.board, console=StandardError(file=Gone()))
    with pytest.raises(BrokenPipeError):  # Rich alone would raise SystemExit
        status.on_tick(world.tick())
    status.close()


def shown(report: FlightReport) -> str:
    out = io.StringIO()
    Console(file=out, width=200, color_system=None).print(summary(report, default_mark()))
    return out.getvalue()


MAPPED = {"objects_found": 5, "objects_total": 6, "map_drift_m": 0.11, "map_restarts": 0}
POOR = {**MAPPED, "false_objects": 1, "map_drift_90s_m": 0.08, "map_restarts": 2}
DRAWN = {"movers": 1, "vary_room": True, "faults": ["wind=0.1@explore", "black@land~2"]}
SHORT = {"duration_s": 22.0, "time_to_find_mark_s": None, "landing_error_m": 1.2}


@pytest.mark.parametrize(
    ("changes", "name", "words"),
    [
        ({}, "outcome", "success  landed"),
        ({"reason": "touched [red] box"}, "outcome", "success  touched [red] box"),
        ({}, "mission", "explore_and_land in train-a, seed 3"),
        ({}, "landing error", "0.024 m from the mark's centre"),
        (SHORT, "landing error", None),  # no mark was sought
        ({}, "first 90 s", "9.59 m"),
        (SHORT, "first 90 s", None),  # it is all of the flight
        (SHORT, "total distance", "12.96 m"),
        ({}, "landing", None),  # it was not reached
        ({}, "ground", "61 % of the free ground covered, 84 % seen"),
        (DRAWN, "room", "boxes placed and sized by the seed 3"),
        (DRAWN, "movers", "1 added to those of the scene"),
        (DRAWN, "faults", "wind=0.1@explore"),
        (DRAWN, "", "black@land~2"),
        ({}, "faults", None),
        ({}, "objects", None),
        (MAPPED, "objects", "5 of 6 found"),
        (MAPPED, "map drift", "0.11 m at the end"),
        (POOR, "objects", "5 of 6 found, 1 false"),
        (POOR, "map drift", "0.08 m after 90 s, 0.11 m at the end, begun anew 2 times"),
        ({"photos": ["one", "two"]}, "photos", "2 stored"),
        ({}, "segmentation", "0.8 ms median, 6.7 ms 99 %, 9.0 ms at most"),
    ],
)
def test_known_values_are_summed_up(changes: dict[str, Any], name: str, words: str | None) -> None:
    lines = shown(replace(flight_report(), **changes)).splitlines()
    rows = {line[:17].strip(): line[17:].strip() for line in lines}
    assert rows.get(name) == words


def test_the_summary_has_the_last_events_but_no_phases() -> None:
    phase = event(30.0, EventKind.PHASE, "land")
    many = [event(float(n), EventKind.INFO, f"message {n}") for n in range(25)]
    usual = event(31.0, EventKind.EXPECTED, "Explore: edge")
    again = event(40.0, EventKind.INFO, "message 20")
    text = shown(replace(flight_report(), events=[*many, phase, usual, again]))
    assert re.findall(r"message (\d+)", text) == [str(n) for n in range(15, 25)]
    assert "20.0 s  info: message 20 (2 times)" in text
    assert "phase" not in text
    assert "Explore" not in text
    assert "and 15 before, in the report" in text


def test_the_summary_fits_a_terminal_of_80_columns() -> None:
    times = Percentiles(p50=1234.5, p99=1234.5, max=12345.6)
    report = replace(
        flight_report(),
        **{**POOR, "map_restarts": 12},
        outcome="left_area",
        reason="flew beyond the ground's edge at (-2.51, -1.99) m",
        tree="explore_and_land_student_guarded.xml",
        tick_ms=times,
    )
    assert max(len(line.rstrip()) for line in shown(report).splitlines()) <= 80
