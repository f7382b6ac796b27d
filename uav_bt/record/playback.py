"""Plays a record to tick listeners, such as views and videos.

playback = Playback(RecordReader(Path("flight.mcap")))
for tick in playback.ticks():
    video.on_tick(tick)
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, Final

from uav_bt import board as keys
from uav_bt.board.blackboard import Blackboard, Key
from uav_bt.clock import ManualClock
from uav_bt.mission.tick import TickRecord
from uav_bt.record.moment import Moment
from uav_bt.record.reader import RecordReader
from uav_bt.tree.status import Status
from uav_bt.types import Frame, Observation
from uav_bt.types.site_map import SiteMap

# Values with a separate channel, by their name in `Moment` and on the board.
_VALUES: Final[tuple[Key[Any], ...]] = (
    *(keys.CLASS_MAP, keys.RELATIVE_DEPTH, keys.METRIC_DEPTH, keys.CORRIDOR, keys.MARK),
)
# Values that the board's message has.
_PLAIN: Final[tuple[Key[Any], ...]] = (keys.ELAPSED, keys.PHASE)


class Playback:
    """One record, tick by tick, with the board and the statuses after each tick."""

    def __init__(self, reader: RecordReader) -> None:
        self._reader = reader
        self._clock = ManualClock(reader.timeline.start_s)
        self._paths = tuple(node.path for node in reader.tree.nodes)
        self._statuses: tuple[str, ...] = ()
        self._frame: Frame | None = None
        self._map: SiteMap | None = None  # the last map; a record has two per second
        self.board = Blackboard(self._clock, keys.MISSION_KEYS)

    def statuses(self) -> Mapping[str, Status]:
        """Return the nodes' statuses after the last tick, by path."""
        return {
            path: Status[status] for path, status in zip(self._paths, self._statuses, strict=False)
        }

    def ticks(
        self, *, from_s: float | None = None, to_s: float | None = None
    ) -> Iterator[TickRecord]:
        """Yield the ticks; the board has the values of a tick until the next one is requested.

        `from_s` and `to_s` (not included) count from the record's start.
        """
        for moment in self._reader.moments(from_s=from_s, to_s=to_s):
            self._clock.sleep_until(moment.tick.time_s)
            self._statuses = moment.statuses
            with self._reader.intact(f"tick {moment.tick.index}"):
                if moment.frame is not None and moment.frame.image is not None:
                    self._frame = moment.frame.frame()
                self._write_board(moment)
            yield self._tick(moment)

    def _tick(self, moment: Moment) -> TickRecord:
        note, commands = moment.tick, moment.commands
        return TickRecord(
            index=note.index,
            time_s=note.time_s,
            observation=Observation(frame=self._frame, state=moment.state),
            tree_status=Status[note.tree_status],
            phase=note.phase,
            active=note.active,
            command=commands.sent,
            proposed_by=commands.proposed_by,
            override=commands.override,
            compute_s=note.compute_s,
            truth=moment.truth,
            feedback=note.word,
            decided=commands.decided,
        )

    def _write_board(self, moment: Moment) -> None:
        board = self.board
        self._map = moment.site_map or self._map
        if self._map is not None and moment.near is not None:
            self._map = replace(self._map, near=moment.near)
        values = {key: getattr(moment, key.name) for key in _VALUES}
        values |= {key: moment.board.get(key.name, {}).get("value") for key in _PLAIN}
        is_new = moment.site_map is not None or moment.near is not None
        values[keys.SITE_MAP] = self._map if is_new else None
        for key, value in values.items():
            entry = moment.board.get(key.name)
            if entry is None or entry["value"] is None:
                board.forget(key)
            elif value is not None:
                board.write(key, value, captured_s=entry["captured_s"])
        board.write(keys.STATE, moment.state, captured_s=moment.state.captured_s)
        board.write(keys.HEIGHT, moment.state.height_above_ground_m)
        board.write(keys.CAMERA, self._reader.camera)
        if self._frame is not None:
            board.write(keys.FRAME, self._frame, captured_s=self._frame.captured_s)
