"""Status line of a running flight, and summary table of a finished one."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from types import TracebackType
from typing import Final, Self

from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from uav_bt.board import ELAPSED, MARK
from uav_bt.board.blackboard import Blackboard
from uav_bt.display.flown_path import FlownPath
from uav_bt.display.phrases import (
    describe_coverage,
    describe_drift,
    describe_flight,
    describe_movement,
    describe_objects,
    lands_on_mark,
)
from uav_bt.mission.flight_report import EXPLORE_S, FlightReport, Percentiles
from uav_bt.mission.judge import Outcome
from uav_bt.mission.safety import Override
from uav_bt.mission.tick import TickRecord
from uav_bt.types import DroneState, LandingMark, MoveBy, Velocity
from uav_bt.types.flight_results import EventKind

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
    EventKind.PHOTO: "",
    EventKind.NO_PHOTO: "yellow",
}
_SUMMED_UP: Final = frozenset(EventKind) - {EventKind.PHASE, EventKind.PHOTO, EventKind.LANDED}
_EVENTS: Final = 10  # of the summary, at most


class StandardError(Console):
    """A console whose broken pipe ends the tick listener instead of the program."""

    def on_broken_pipe(self) -> None:
        """Raise the error; Rich would end the program.

        Raises:
            BrokenPipeError: always.
        """
        raise  # noqa: PLE0704  # Rich calls this while it handles the error


class LiveStatus:
    """A tick listener that updates one status line. Use it as a context manager, or close it.

    On a terminal the line is redrawn in place. Elsewhere one line is written every ten seconds of
    mission time, so that a log stays short. Overrides, messages of leaves and photographs are
    always shown at once.

    Args:
        board: board of the mission, source of time and mark fix.
        console: output; default: the standard error stream.
        wall_clock_s: returns the real time, s; tests pass a simulated clock.
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
        self._descent_shown_s: float | None = None  # wall time of the last line about the landing
        self._live: Live | None = None
        self._override: Override | None = None  # override of the last tick

    def on_tick(self, record: TickRecord) -> None:
        """Show a tick, if due."""
        self._flown.add(record)
        now_s = self._wall_clock_s()
        at_once = self._began is None or record.override is not self._override
        if self._began is None:
            self._began = (record.time_s, now_s)
        if at_once and record.override in _ACT:
            words = f"{record.override.value}: {_ACT[record.override]}"
            self._console.print(Text(words, style="bold red"), soft_wrap=True)
        self._override = record.override
        for event in record.events:
            if event.kind in _MESSAGES:
                text = Text(str(event), style=_MESSAGES[event.kind])
                self._console.print(text, soft_wrap=True)
        if not self._console.is_terminal:
            if at_once or record.time_s - self._shown_s >= _LINE_EVERY_S - 1e-6:
                self._shown_s = record.time_s
                self._console.print(self.line(record, now_s), soft_wrap=True)
            return
        if self._live is None:
            self._live = Live(console=self._console, auto_refresh=False, transient=True)
            self._live.start()
        if at_once or now_s - self._shown_s >= _REDRAW_S:
            self._shown_s = now_s
            self._live.update(self.line(record, now_s), refresh=True)

    def on_descent(self, state: DroneState | None, reason: str) -> None:
        """Show that the drone is being landed, and the reason."""
        now_s = self._wall_clock_s()
        text = descent_line(state, reason)
        if self._live is not None:
            self._live.update(text, refresh=True)
        elif (
            self._descent_shown_s is None or now_s - self._descent_shown_s >= _DESCENT_LINE_EVERY_S
        ):
            self._descent_shown_s = now_s
            self._console.print(text, soft_wrap=True)

    def line(self, record: TickRecord, wall_s: float) -> Text:
        """Return the status line of a tick."""
        mission_s, began_s = self._began or (record.time_s, wall_s)
        elapsed_s = self._board.read(ELAPSED).value or 0.0
        fix = self._board.read(MARK).value
        parts = [
            (f"{record.phase or 'ready':<9}", "bold yellow"),
            (f"{elapsed_s:6.1f} s", ""),
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
        text = Text(no_wrap=True, overflow="ellipsis")
        for index, (words, style) in enumerate(parts):
            text.append("  " if index else "")
            text.append(words, style=style)
        return text

    def close(self) -> None:
        """Remove the line; safe to call twice."""
        live, self._live = self._live, None
        if live is not None:
            with suppress(OSError):  # the terminal may be gone
                live.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        self.close()


def descent_line(state: DroneState | None, reason: str) -> Text:
    """Return the line about a drone that is being landed.

    Args:
        state: newest state; None before the first.
        reason: reason of the landing.
    """
    known = "not heard" if state is None else state.flying.value.replace("_", " ")
    return Text(f"landing ({known}): {reason}", style="bold red", no_wrap=True, overflow="ellipsis")


_SENTENCES: Final = {
    "ground": describe_coverage,
    "objects": describe_objects,
    "map drift": describe_drift,
}


def summary(report: FlightReport, mark: LandingMark) -> Table:
    """Return the report of a flight as a table.

    Args:
        report: report of the flight.
        mark: landing mark of the place.
    """
    good = report.outcome == Outcome.SUCCESS.value
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    table.add_column(style="dim")
    table.add_column()
    words = report.outcome.replace("_", " ")
    outcome = Text(words, style="bold green" if good else "bold red")
    if report.reason and report.reason != words:
        outcome.append(f"  {report.reason}", style="default not bold")
    table.add_row("outcome", outcome)
    flight = describe_flight(report.tree, scene=report.scene, drone=report.drone, seed=report.seed)
    table.add_row("mission", Text(flight))
    _add_changes(table, report)
    for name, value, unit, digits in _numbers(report, mark):
        if value is not None:
            table.add_row(name, f"{value:.{digits}f} {unit}")
    for name, describe in _SENTENCES.items():
        if words := describe(report):
            table.add_row(name, words)
    if report.photos:
        table.add_row("photos", f"{len(report.photos)} stored")
    _add_events(table, report)
    table.add_row("tick", _milliseconds(report.tick_ms))
    for stage, times in report.perception_ms.items():
        table.add_row(Text(f"  {stage}"), _milliseconds(times))
    return table


def _add_changes(table: Table, report: FlightReport) -> None:
    """Add the room, movers and faults that were given or drawn for the flight."""
    if report.vary_room:
        table.add_row("room", f"boxes placed and sized by the seed {report.seed}")
    if report.movers:
        table.add_row("movers", f"{report.movers} added to those of the scene")
    for index, fault in enumerate(report.faults):
        table.add_row("" if index else "faults", Text(fault))


def _add_events(table: Table, report: FlightReport) -> None:
    events = [event for event in report.events if event.kind in _SUMMED_UP]
    for index, event in enumerate(events[-_EVENTS:]):
        table.add_row("" if index else "events", Text(str(event)))
    if len(events) > _EVENTS:
        table.add_row("", f"and {len(events) - _EVENTS} before, in the report")
    for index, warning in enumerate(report.warnings):
        table.add_row("" if index else "warnings", Text(warning, style="yellow"))


def _numbers(
    report: FlightReport, mark: LandingMark
) -> Iterator[tuple[str, float | None, str, int]]:
    """Yield name, value, unit and decimal places of the mission's results."""
    yield "duration", report.duration_s, "s", 1
    if (report.duration_s or 0.0) > EXPLORE_S:  # otherwise it equals the total distance
        yield f"first {EXPLORE_S:.0f} s", report.explore_distance_m, "m", 2
    yield "total distance", report.total_distance_m, "m", 2
    yield "search", report.time_to_find_mark_s, "s until the mark was found", 1
    yield "landing", report.time_to_land_s, "s from there", 1
    if lands_on_mark(report, mark):
        yield "landing error", report.landing_error_m, "m from the mark's centre", 3
    yield "least clearance", report.min_clearance_m, "m to an obstacle", 2


def _milliseconds(times: Percentiles | None) -> str:
    if times is None:
        return "-"
    return f"{times.p50:.1f} ms median, {times.p99:.1f} ms 99 %, {times.max:.1f} ms at most"


class OrderLines:
    """A tick listener that writes each order as it changes.

    Args:
        write: takes a line.
    """

    def __init__(self, write: Callable[[str], None]) -> None:
        self._write = write
        self._last: object = None

    def on_tick(self, record: TickRecord) -> None:
        """Write the tick's order, unless it is the one before: speeds change all the time."""
        movement = record.command.movement
        order: object = type(movement)
        if isinstance(movement, MoveBy):
            order = movement.id
        if order != self._last:
            self._last = order
            more = ", then at changing speeds" if isinstance(movement, Velocity) else ""
            self._write(
                f"{record.time_s:6.1f} s  would be sent: {describe_movement(movement)}{more}"
            )
