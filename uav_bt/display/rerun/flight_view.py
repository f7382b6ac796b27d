"""A flight in Rerun: a tick listener that draws every tick on one timeline."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import rerun as rr

from uav_bt.board import CLASS_MAP, CORRIDOR, HELIPAD, METRIC_DEPTH, OBSTACLES
from uav_bt.board.blackboard import Blackboard
from uav_bt.display.lab_map import FlownPath
from uav_bt.display.phrases import describe_movement
from uav_bt.display.rerun.images import ImageView
from uav_bt.display.rerun.plots import FlightPlots, TreeGraph
from uav_bt.display.rerun.setting import TIMELINE, WORDS, ViewSetting
from uav_bt.display.rerun.world import WorldView
from uav_bt.mission.runner import TickRecord
from uav_bt.tree import Status


class FlightView:
    """Draws a flight into a Rerun recording, live or from a record.

    Args:
        stream: an open recording; its own timelines are switched off.
        setting: what does not change while the flight lasts.
        board: of the mission, as it is after each tick.
        statuses: returns the nodes' statuses by path, as they are after each tick.
        start_s: where the timeline has its zero, of the mission clock; None: at the first tick.
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
        # The mission's time alone: a record must be drawn the same at any time.
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
        corridor, obstacles = board.read(CORRIDOR).value, board.read(OBSTACLES).value
        fix = board.read(HELIPAD).value
        self._world.show_drone(record.time_s, self._flown)
        self._world.show_lens(frame)
        self._images.show_frame(frame, fix)
        self._images.show_mask(class_map)
        self._images.show_depth(depth, corridor, frame, class_map)
        self._world.show_corridor(corridor)
        self._world.show_memory(obstacles, fix)
        self._tree.show(self._statuses())
        self._plots.show(record, corridor=corridor, obstacles=obstacles, fix=fix)
        self._say(record)

    def _say(self, record: TickRecord) -> None:
        """Log what the mission does and what the drone is commanded, when it changes."""
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
