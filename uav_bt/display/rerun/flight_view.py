"""View of a flight in Rerun: a tick listener, and a background thread for live flights."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import rerun as rr

from uav_bt.board import CLASS_MAP, CORRIDOR, MARK, METRIC_DEPTH, SITE_MAP
from uav_bt.board.blackboard import Blackboard
from uav_bt.clock import ManualClock
from uav_bt.display.flown_path import FlownPath
from uav_bt.display.phrases import describe_movement
from uav_bt.display.rerun.images import ImageView
from uav_bt.display.rerun.plots import FlightPlots, TreeGraph
from uav_bt.display.rerun.setting import TIMELINE, WORDS, ViewSetting
from uav_bt.display.rerun.site_map import SiteMapView
from uav_bt.display.rerun.world import WorldView
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.tree import Status


class FlightView:
    """Draws a flight into a Rerun recording, from a live flight or a record.

    Args:
        stream: an open recording; Rerun's default timelines are switched off.
        setting: the constants of the flight.
        board: board of the mission, after each tick.
        statuses: returns the statuses of the nodes by path, after each tick.
        start_s: mission time of the timeline's zero; None: the first tick.
    """

    def __init__(
        self,
        stream: rr.RecordingStream,
        setting: ViewSetting,
        board: Blackboard,
        statuses: Callable[[], Mapping[str, Status]],
        *,
        start_s: float | None = None,
    ) -> None:
        # Only mission time: a record must give the same drawing at any date.
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
        self._stream = stream
        self._board = board
        self._statuses = statuses
        self._flown = FlownPath()
        self._start_s = start_s
        self._words = ""
        if setting.title:
            stream.send_recording_name(setting.title)
        self._images = ImageView(stream, setting)
        self._world = WorldView(stream, setting)
        self._map = SiteMapView(stream, setting.lab_map)
        self._tree = TreeGraph(stream, setting.tree)
        self._plots = FlightPlots(stream)

    def on_tick(self, record: TickRecord) -> None:
        """Draw a tick."""
        if self._start_s is None:
            self._start_s = record.time_s
        self._stream.set_time(TIMELINE, duration=record.time_s - self._start_s)
        self._flown.add(record)
        frame, board = record.observation.frame, self._board
        class_map, depth = board.read(CLASS_MAP).value, board.read(METRIC_DEPTH).value
        corridor, site_map = board.read(CORRIDOR).value, board.read(SITE_MAP).value
        near = None if site_map is None else site_map.near
        fix = board.read(MARK).value
        self._world.show_drone(record.time_s, self._flown)
        self._world.show_movers(self._flown.movers)
        self._world.show_lens(frame)
        self._images.show_frame(frame, fix)
        self._images.show_mask(class_map)
        self._images.show_depth(depth, corridor, frame, class_map)
        self._world.show_corridor(corridor)
        self._world.show_near(near, fix)
        self._map.show(record, self._flown, site_map)
        self._tree.show(self._statuses())
        self._plots.show(record, corridor=corridor, near=near, fix=fix)
        self._log_words(record)

    def _log_words(self, record: TickRecord) -> None:
        """Log phase, active leaf and command when they change."""
        leaf = record.active[-1] if record.active else "idle"
        command = describe_movement(record.command.movement)
        why = f" ({record.feedback})" if record.feedback else ""
        words = f"{record.phase or '-'}: {leaf}{why}: {command}"
        if record.override is not None:
            words += f" [{record.override.value}]"
        if words != self._words:
            self._words = words
            level = "WARN" if record.override is not None else "INFO"
            self._stream.log(WORDS, rr.TextLog(words, level=level))


_LOG = logging.getLogger(__name__)
_WAITING_TICKS: Final = 32  # size of the queue; its frames need 22 MB at 640x360

Statuses = Callable[[], Mapping[str, Status]]


@dataclass(frozen=True, kw_only=True)
class _Moment:
    record: TickRecord
    board: dict[str, tuple[Any, float]]  # value and capture time by key
    statuses: Mapping[str, Status]


class BackgroundFollower:
    """Passes ticks to a follower in another thread; ticks that it cannot keep up with are dropped.

    A view must not affect the flight: a follower that raises an error gets no more ticks.

    Args:
        make: makes the follower from a board and statuses that are constant during a tick.
        board: board of the mission.
        statuses: returns the statuses of the nodes by path.
        waiting_ticks: size of the queue.
    """

    def __init__(
        self,
        make: Callable[[Blackboard, Statuses], TickListener],
        board: Blackboard,
        statuses: Statuses,
        *,
        waiting_ticks: int = _WAITING_TICKS,
    ) -> None:
        self.left_out = 0  # number of dropped ticks
        self.failure: Exception | None = None
        self._board = board
        self._statuses = statuses
        self._clock = ManualClock()
        self._mirror = Blackboard(self._clock, board.keys.values())
        self._tick_statuses: Mapping[str, Status] = {}
        self._follower = make(self._mirror, lambda: self._tick_statuses)
        self._waiting: queue.Queue[_Moment | None] = queue.Queue(waiting_ticks)
        self._thread = threading.Thread(target=self._follow, name="view", daemon=True)
        self._thread.start()

    def on_tick(self, record: TickRecord) -> None:
        """Queue a tick."""
        if self.failure is not None:
            return
        moment = _Moment(
            record=record, board=self._board.snapshot(), statuses=dict(self._statuses())
        )
        try:
            self._waiting.put_nowait(moment)
        except queue.Full:
            self.left_out += 1

    def close(self) -> None:
        """Process the queued ticks and stop; safe to call twice."""
        if self._thread.is_alive():
            self._waiting.put(None)
            self._thread.join()
        if self.left_out:
            _LOG.warning("the view dropped %d ticks: this machine is too busy", self.left_out)
            self.left_out = 0

    def _follow(self) -> None:
        while (moment := self._waiting.get()) is not None:
            if self.failure is None:
                self._show(moment)

    def _show(self, moment: _Moment) -> None:
        try:
            self._reflect(moment)
            self._follower.on_tick(moment.record)
        except Exception as error:  # noqa: BLE001 - the flight continues after any error
            self.failure = error
            _LOG.warning("the view ended: %s: %s", type(error).__name__, error)

    def _reflect(self, moment: _Moment) -> None:
        self._clock.sleep_until(moment.record.time_s)
        self._tick_statuses = moment.statuses
        for name, key in self._board.keys.items():
            if name not in self._mirror.keys:
                self._mirror.declare(key)
            if name in moment.board:
                value, captured_s = moment.board[name]
                self._mirror.write(key, value, captured_s)
            else:
                self._mirror.forget(key)
