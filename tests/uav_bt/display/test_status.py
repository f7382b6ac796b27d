"""The status line and the summary."""

import io
from contextlib import closing
from dataclasses import replace
from typing import Any

import pytest
from rich.console import Console

from tests.uav_bt.display.display_world import World, flight_report
from uav_bt.board.context import MissionContext
from uav_bt.display.status import LiveStatus, StandardError, summary
from uav_bt.lab.shipped import default_mark
from uav_bt.mission.flight_report import FlightReport, Percentiles
from uav_bt.mission.judge import Judge, Outcome, Verdict
from uav_bt.mission.runner import MissionRunner
from uav_bt.mission.safety import Override
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import Drone
from uav_bt.testing import ScriptedDrone
from uav_bt.testing.faults import Fault, FaultyDrone
from uav_bt.tree import parse_tree
from uav_bt.types import CutMotors, FlyingState, Pose
from uav_bt.types.flight_results import EventKind, FlightEvent, Photo


class Wall:
    """A wall clock that the test sets."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def watch(world: World, *, terminal: bool) -> tuple[LiveStatus, io.StringIO, Wall]:
    out, wall = io.StringIO(), Wall()
    console = Console(file=out, force_terminal=terminal, width=120, color_system=None)
    return LiveStatus(world.board, console=console, wall_clock_s=wall), out, wall


def test_without_a_terminal_a_line_comes_every_ten_seconds_of_mission_time() -> None:
    world = World()
    status, out, wall = watch(world, terminal=False)
    for _ in range(251):
        status.on_tick(world.tick())
        wall.now_s += 0.01
    status.close()
    lines = out.getvalue().splitlines()
    assert [line.split()[:3] for line in lines] == [
        ["explore", "0.0", "s"],
        ["explore", "10.0", "s"],
        ["explore", "20.0", "s"],
    ]


def test_a_line_holds_phase_pace_height_way_mark_and_the_running_leaf() -> None:
    world = World()
    world.see()
    status, _, wall = watch(world, terminal=False)
    status.on_tick(world.tick(pose=Pose(x_m=0.0, y_m=0.0, z_m=1.5, yaw_rad=0.0)))
    record = world.tick(pose=Pose(x_m=2.0, y_m=0.0, z_m=1.5, yaw_rad=0.0))
    status.on_tick(record)
    assert status.line(record, wall.now_s + 0.02).plain == (
        "explore       0.1 s  5.0x  height 1.50 m  flown 2.0 m  mark 1.2 m  Explore: clear"
    )


def test_an_override_takes_the_place_of_the_leaf() -> None:
    world = World()
    status, _, wall = watch(world, terminal=False)
    record = world.tick(override=Override.MANUAL)
    status.on_tick(record)
    line = status.line(record, wall.now_s).plain
    assert line.endswith("mark -  manual take-over")


def test_a_warning_stands_behind_the_leaf() -> None:
    world = World()
    status, _, wall = watch(world, terminal=False)
    record = replace(world.tick(), warnings=("it drifts",))
    assert status.line(record, wall.now_s).plain.endswith("Explore: clear  it drifts")


def test_messages_of_leaves_are_shown_at_once_and_other_events_are_not() -> None:
    world = World()
    status, out, _ = watch(world, terminal=False)
    status.on_tick(world.tick())
    events = (event(1.25, EventKind.WARNING, "low battery"), event(1.25, EventKind.PHASE, "land"))
    status.on_tick(replace(world.tick(), events=events))
    assert out.getvalue().splitlines()[1:] == ["1.2 s  warning: low battery"]


def event(time_s: float, kind: EventKind, text: str) -> FlightEvent:
    return FlightEvent(time_s=time_s, kind=kind, text=text)


def test_the_summary_has_the_last_events() -> None:
    ended = event(30.0, EventKind.ENDED, "the tree failed at Turn")
    phase = event(30.0, EventKind.PHASE, "land")
    photo = Photo(
        label="",
        file="photo-001.jpg",
        class_map=None,
        time_s=1.0,
        pose=None,
        height_m=1.5,
        gimbal_pitch_deg=-30.0,
    )
    text = shown(replace(flight_report(), events=[phase, ended], photos=[photo, photo]))
    assert "2 stored" in text
    assert "30.0 s  ended: the tree failed at Turn" in text
    assert "phase" not in text
    many = [event(float(n), EventKind.INFO, f"message {n}") for n in range(25)]
    text = shown(replace(flight_report(), events=many))
    assert "message 14" not in text
    assert "message 15" in text
    assert "message 24" in text
    assert "and 15 before, in the report" in text


def test_an_override_is_shown_at_once_and_so_is_its_end() -> None:
    world = World()
    status, out, _ = watch(world, terminal=False)
    for override in (None, None, Override.STALE_FRAME, Override.STALE_FRAME, None, None):
        status.on_tick(world.tick(override=override))
    ends = [line.split("  ")[-1] for line in out.getvalue().splitlines()]
    assert ends == ["Explore: clear", "stale frame", "Explore: clear"]


@pytest.mark.parametrize("terminal", [False, True])
def test_a_lost_link_says_what_to_do(*, terminal: bool) -> None:
    world = World()
    status, out, _ = watch(world, terminal=terminal)
    with closing(status):
        for override in (None, Override.LINK, Override.LINK):
            status.on_tick(world.tick(override=override))
    assert out.getvalue().count("link lost: take the remote control") == 1


CUT_SHORT = """
<root BTCPP_format="4"><BehaviorTree ID="M">
  <Sequence><TakeOff height_m="1"/><HoverFor seconds="60"/><Land/></Sequence>
</BehaviorTree></root>"""


@pytest.mark.parametrize("says", [FlyingState.LANDED, FlyingState.EMERGENCY])
def test_cut_motors_end_the_mission_at_once_and_are_shown(says: FlyingState) -> None:
    scripted = ScriptedDrone()
    # The scripted drone reports that it has landed, an ANAFI that its motors were cut.
    drone: Drone = scripted
    if says is FlyingState.EMERGENCY:
        drone = FaultyDrone(scripted, Fault.parse("emergency-state@hover+1.1"))
    context = MissionContext(clock=scripted.clock)
    tree = parse_tree(CUT_SHORT)
    tree.setup(context)
    out = io.StringIO()
    console = Console(file=out, force_terminal=True, width=120, color_system=None)
    ticks: list[TickRecord] = []

    class Pilot:
        def on_tick(self, record: TickRecord) -> None:
            ticks.append(record)
            if [each.phase for each in ticks].count("hover") == 11:
                runner.abort.cut_motors("a person cut the motors")

    with closing(LiveStatus(context.board, console=console)) as status:
        followers = [each for each in (status, drone, Pilot()) if hasattr(each, "on_tick")]
        runner = MissionRunner(drone, tree, context, Judge(), listeners=followers)
        drone.connect()
        verdict = runner.run()
    assert verdict == Verdict(outcome=Outcome.ABORTED, reason="a person cut the motors")
    assert isinstance(scripted.commands[-1].movement, CutMotors)
    assert [each.override for each in ticks].count(Override.CUT) in {1, 2}
    assert out.getvalue().count("motors cut: keep clear, then take the remote control") == 1


def test_on_a_terminal_the_line_is_redrawn_no_faster_than_it_is_read() -> None:
    world = World()
    status, out, wall = watch(world, terminal=True)
    with closing(status):
        for _ in range(100):
            status.on_tick(world.tick())
            wall.now_s += 0.01
    redrawn = out.getvalue().count("height 1.50 m")
    assert 4 <= redrawn <= 7, "five times in this second, and once for taking it away"


def test_a_drone_that_is_brought_down_is_shown_with_the_reason() -> None:
    world = World()
    status, out, wall = watch(world, terminal=False)
    state = world.tick().observation.state
    for _ in range(61):
        status.on_descent(state, "nothing heard for 10 s; take it over")
        wall.now_s += 0.1
    assert (
        out.getvalue().splitlines()
        == [f"landing ({state.flying.value}): nothing heard for 10 s; take it over"] * 2
    )
    status.on_descent(None, "lost")  # before the first telemetry


def test_on_a_terminal_the_landing_takes_the_place_of_the_line() -> None:
    world = World()
    status, out, _ = watch(world, terminal=True)
    with closing(status):
        status.on_tick(world.tick())
        status.on_descent(None, "no link")
    assert "landing (not heard): no link" in out.getvalue()


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


def test_the_cursor_comes_back_when_the_flight_fails() -> None:
    world = World()
    status, out, _ = watch(world, terminal=True)
    with pytest.raises(RuntimeError), closing(status):
        _fail_after(status, world)
    assert out.getvalue().rindex("\x1b[?25h") > out.getvalue().rindex("\x1b[?25l")


def _fail_after(status: LiveStatus, world: World) -> None:
    status.on_tick(world.tick())
    raise RuntimeError


def shown(report: FlightReport, width: int = 200) -> str:
    out = io.StringIO()
    Console(file=out, width=width, color_system=None).print(summary(report, default_mark()))
    return out.getvalue()


def rows_of(report: FlightReport) -> dict[str, str]:
    return {line[:17].strip(): line[17:].strip() for line in shown(report).splitlines()}


def test_the_summary_tells_how_it_went() -> None:
    rows = rows_of(flight_report())
    assert rows["outcome"] == "success  landed"
    assert rows["mission"] == "explore_and_land in train-a, seed 3"
    assert rows["landing error"] == "0.024 m from the mark's centre"
    assert rows["first 90 s"] == "9.59 m"
    assert rows["ground"] == "61 % of the free ground covered, 84 % seen"
    assert "objects" not in rows, "without a map"
    assert "landing" not in rows, "what was not reached"
    assert rows["segmentation"].startswith("0.8 ms median")


def test_the_summary_names_what_was_drawn_for_the_flight() -> None:
    drawn = {"movers": 1, "vary_room": True, "faults": ["wind=0.1@explore", "black@land~2"]}
    rows = rows_of(replace(flight_report(), **drawn))
    assert rows["room"] == "boxes placed and sized by the seed 3"
    assert rows["movers"] == "1 added to those of the scene"
    assert rows["faults"] == "wind=0.1@explore"
    assert "black@land~2" in rows.values()
    assert not {"room", "movers", "faults"} & rows_of(flight_report()).keys()


def mapped(**fields: Any) -> FlightReport:
    known = {"objects_found": 5, "objects_total": 6, "map_drift_m": 0.11, "map_restarts": 0}
    return replace(flight_report(), **known | fields)


def test_the_summary_tells_how_the_map_agrees_with_the_place() -> None:
    rows = rows_of(mapped())
    assert (rows["objects"], rows["map drift"]) == ("5 of 6 found", "0.11 m at the end")
    rows = rows_of(mapped(false_objects=1, map_drift_90s_m=0.08, map_restarts=2))
    assert rows["objects"] == "5 of 6 found, 1 false"
    assert rows["map drift"] == "0.08 m after 90 s, 0.11 m at the end, begun anew 2 times"


def test_of_a_short_flight_the_first_part_is_all_of_it() -> None:
    rows = rows_of(replace(flight_report(), duration_s=22.0))
    assert rows["total distance"] == "12.96 m"
    assert "first 90 s" not in rows


def test_the_summary_speaks_of_the_mark_where_the_mission_is_about_it() -> None:
    elsewhere = replace(flight_report(), time_to_find_mark_s=None, landing_error_m=1.2)
    assert "landing error" not in rows_of(elsewhere)
    assert "mark" not in shown(elsewhere)


def test_the_summary_fits_a_terminal_of_80_columns() -> None:
    times = Percentiles(p50=1234.5, p99=1234.5, max=12345.6)
    report = replace(
        mapped(map_drift_90s_m=0.08, map_restarts=12, false_objects=3),
        outcome="left_area",
        reason="flew beyond the ground's edge at (-2.51, -1.99) m",
        tree="explore_and_land_student_guarded.xml",
        tick_ms=times,
        perception_ms={"relative_depth": times},
    )
    wide, narrow = shown(report), shown(report, width=80)
    assert [line.rstrip() for line in narrow.splitlines()] == [
        line.rstrip() for line in wide.splitlines()
    ]


def test_the_summary_takes_reasons_literally() -> None:
    assert "touched [red] box" in shown(flight_report("collision", "touched [red] box"))
