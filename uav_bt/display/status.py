"""Status line of a running flight, and summary table of a finished one."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Final

from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from uav_bt.board import ELAPSED, MARK
from uav_bt.board.blackboard import Blackboard
from uav_bt.display.phrases import describe_flight, describe_movement, lands_on_mark
from uav_bt.display.shown import FlownPath
from uav_bt.mission.flight_report import EXPLORE_S, FlightReport, Percentiles
from uav_bt.mission.judge import Outcome
from uav_bt.mission.safety import Override
from uav_bt.mission.tick import TickRecord
from uav_bt.types import DroneState, LandingMark, MoveBy, Velocity
from uav_bt.types.flight_results import EventKind, shown_events

_REDRAW_S: Final = 0.2  # wall time between redraws; faster ones are unreadable
_DESCENT_LINE_EVERY_S: Final = 5.0  # wall time between lines during a descent
_LINE_EVERY_S: Final = 10.0  # mission time between lines without a terminal
_ACT: Final = {  # actions for the operator; they stay on the screen
    Override.CUT: "keep clear, then take the remote control",
    Override.LINK: "take the remote control",
}
_MESSAGES: Final = {  # events that are shown at once, with their colours
    EventKind.INFO: "",
    EventKind.WARNING: "yellow",
    EventKind.FAILED: "yellow",
    EventKind.PHOTO: "",
    EventKind.NO_PHOTO: "yellow",
}
_EVENTS: Final = 10  # of the summary, at most


class StandardError(Console):
    """A console whose broken pipe ends the tick listener instead of the program."""

    def on_broken_pipe(self) -> None:
        """Raise the error; Rich would end the program."""
        raise  # noqa: PLE0704  # Rich calls this while it handles the error


class LiveStatus:
    """A tick listener that updates one status line until it is closed.

    On a terminal the line is redrawn in place. Elsewhere one line is written every ten seconds of
    mission time, so that a log stays short. Overrides, messages of leaves and photographs are
    always shown at once.
    """

    def __init__(
        self,
        board: Blackboard,
        *,
        console: Console | None = None,
        wall_clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._board = board
        self._console = console or StandardError(stderr=True)
        self._wall_clock_s = wall_clock_s
        self._flown = FlownPath()
        self._began: tuple[float, float] | None = None  # mission and wall time of the first tick
        self._shown_s = 0.0  # wall time of the last redraw, mission time of the last line
        self._descent_shown_s = -math.inf  # wall time of the last line about the landing
        self._live = Live(console=self._console, auto_refresh=False, transient=True)
        self._override: Override | None = None  # override of the last tick

    def on_tick(self, record: TickRecord) -> None:
        """Show a tick, if due."""
        self._flown.add(record)
        now_s = self._wall_clock_s()
        at_once = self._began is None or record.override is not self._override
        self._began = self._began or (record.time_s, now_s)
        self._override = record.override
        if at_once and record.override in _ACT:
            self._print(f"{record.override.value}: {_ACT[record.override]}", "bold red")
        for event in record.events:
            if event.kind in _MESSAGES:
                self._print(str(event), _MESSAGES[event.kind])
        terminal = self._console.is_terminal
        clock_s, every_s = (now_s, _REDRAW_S) if terminal else (record.time_s, _LINE_EVERY_S)
        if not at_once and clock_s - self._shown_s < every_s - 1e-6:
            return
        self._shown_s = clock_s
        line = self.line(record, now_s)
        if not terminal:
            self._console.print(line, soft_wrap=True)
            return
        self._live.start()
        self._live.update(line, refresh=True)

    def _print(self, words: str, style: str) -> None:
        self._console.print(Text(words, style=style), soft_wrap=True)

    def on_descent(self, state: DroneState | None, reason: str) -> None:
        """Show that the drone is being landed, and the reason; the state may be unknown."""
        known = "not heard" if state is None else state.flying.value.replace("_", " ")
        words, now_s = f"landing ({known}): {reason}", self._wall_clock_s()
        if self._live.is_started:
            text = Text(words, style="bold red", no_wrap=True, overflow="ellipsis")
            self._live.update(text, refresh=True)
        elif now_s - self._descent_shown_s >= _DESCENT_LINE_EVERY_S:
            self._descent_shown_s = now_s
            self._print(words, "bold red")

    def line(self, record: TickRecord, wall_s: float) -> Text:
        """Return the status line of a tick."""
        mission_s, began_s = self._began or (record.time_s, wall_s)
        fix = self._board.read(MARK).value
        parts = [
            (f"{record.phase or 'ready':<9}", "bold yellow"),
            (f"{self._board.read(ELAPSED).value or 0.0:6.1f} s", ""),
        ]
        if wall_s > began_s:
            parts.append((f"{(record.time_s - mission_s) / (wall_s - began_s):.1f}x", "dim"))
        parts += [
            (f"height {record.observation.state.height_above_ground_m:.2f} m", ""),
            (f"flown {self._flown.distance_m:.1f} m", ""),
            (f"mark {fix.range_m:.1f} m" if fix is not None else "mark -", ""),
        ]
        if record.override is not None:
            why = f": {record.refused[0]}" if record.refused else ""
            parts.append((f"{record.override.value}{why}", "bold red"))
        elif record.active:
            word = f": {record.feedback}" if record.feedback else ""
            parts.append((f"{record.active[-1]}{word}", "cyan"))
        parts += [(warning, "yellow") for warning in record.warnings]
        space = Text("  ", no_wrap=True, overflow="ellipsis")
        return space.join(Text(words, style=style) for words, style in parts)

    def close(self) -> None:
        """Remove the line; safe to call twice."""
        with suppress(OSError):  # the terminal may be gone
            self._live.stop()


class OrderLines:
    """A tick listener that writes each order as it changes."""

    def __init__(self, write: Callable[[str], None]) -> None:
        self._write = write
        self._last: object = None

    def on_tick(self, record: TickRecord) -> None:
        """Write the tick's order, unless it is the one before: speeds change all the time."""
        movement = record.command.movement
        order: object = movement.id if isinstance(movement, MoveBy) else type(movement)
        if order != self._last:
            self._last = order
            more = ", then at changing speeds" if isinstance(movement, Velocity) else ""
            words = f"{describe_movement(movement)}{more}"
            self._write(f"{record.time_s:6.1f} s  would be sent: {words}")


def summary(report: FlightReport, mark: LandingMark) -> Table:
    """Return the report of a flight as a table."""
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    table.add_column(style="dim")
    table.add_column()
    good = report.outcome == Outcome.SUCCESS.value
    words = report.outcome.replace("_", " ")
    outcome = Text(words, style="bold green" if good else "bold red")
    if report.reason and report.reason != words:
        outcome.append(f"  {report.reason}", style="default not bold")
    table.add_row("outcome", outcome)
    for name, value in _rows(report, mark):
        table.add_row(name, Text(value))
    for name, warning in _named("warnings", report.warnings):
        table.add_row(name, Text(warning, style="yellow"))
    table.add_row("tick", _milliseconds(report.tick_ms))
    for stage, times in report.perception_ms.items():
        table.add_row(Text(f"  {stage}"), _milliseconds(times))
    return table


def _named(name: str, values: Sequence[object]) -> Iterator[tuple[str, str]]:
    """Yield rows of which the first one has the name."""
    for index, value in enumerate(values):
        yield "" if index else name, str(value)


def _rows(report: FlightReport, mark: LandingMark) -> Iterator[tuple[str, str]]:
    """Yield the mission, what was given or drawn for it, its results and its last events."""
    flight = describe_flight(report.tree, scene=report.scene, drone=report.drone, seed=report.seed)
    yield "mission", flight
    if report.vary_room:
        yield "room", f"boxes placed and sized by the seed {report.seed}"
    if report.movers:
        yield "movers", f"{report.movers} added to those of the scene"
    yield from _named("faults", report.faults)
    yield from _numbers(report, mark)
    yield from _map_facts(report)
    if report.photos:
        yield "photos", f"{len(report.photos)} stored"
    events = [*shown_events(report.events)]
    yield from _named("events", events[-_EVENTS:])
    if len(events) > _EVENTS:
        yield "", f"and {len(events) - _EVENTS} before, in the report"


def _numbers(report: FlightReport, mark: LandingMark) -> Iterator[tuple[str, str]]:
    """Yield the mission's results that are known."""
    long = (report.duration_s or 0.0) > EXPLORE_S  # else the first part is all of the distance
    error_m = report.landing_error_m if lands_on_mark(report, mark) else None
    for name, value, digits, words in (
        ("duration", report.duration_s, 1, "s"),
        (f"first {EXPLORE_S:.0f} s", report.explore_distance_m if long else None, 2, "m"),
        ("total distance", report.total_distance_m, 2, "m"),
        ("search", report.time_to_find_mark_s, 1, "s until the mark was found"),
        ("landing", report.time_to_land_s, 1, "s from there"),
        ("landing error", error_m, 3, "m from the mark's centre"),
        ("least clearance", report.min_clearance_m, 2, "m to an obstacle"),
    ):
        if value is not None:
            yield name, f"{value:.{digits}f} {words}"


def _map_facts(report: FlightReport) -> Iterator[tuple[str, str]]:
    """Yield what was covered, and how the map agrees with the place; nothing without a map."""
    if report.coverage_passed is not None and report.coverage_seen is not None:
        passed, seen = 100.0 * report.coverage_passed, 100.0 * report.coverage_seen
        yield "ground", f"{passed:.0f} % of the free ground covered, {seen:.0f} % seen"
    if report.objects_found is not None:
        false = f", {report.false_objects} false" if report.false_objects else ""
        yield "objects", f"{report.objects_found} of {report.objects_total} found{false}"
    if report.map_drift_m is not None:
        early_m = report.map_drift_90s_m
        early = "" if early_m is None else f"{early_m:.2f} m after 90 s, "
        anew = f", begun anew {report.map_restarts} times" if report.map_restarts else ""
        yield "map drift", f"{early}{report.map_drift_m:.2f} m at the end{anew}"


def _milliseconds(times: Percentiles | None) -> str:
    if times is None:
        return "-"
    return f"{times.p50:.1f} ms median, {times.p99:.1f} ms 99 %, {times.max:.1f} ms at most"
