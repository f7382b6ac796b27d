"""Encodes one tick as messages of a record. Runs in the writing thread."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, TypeVar

from uav_bt import board as keys
from uav_bt.board.blackboard import Key
from uav_bt.board.plain_values import plain
from uav_bt.mission.tick import TickRecord
from uav_bt.record import Quality, channels, messages
from uav_bt.record.channels import Channel, CommandNote, StatusNote, TickNote
from uav_bt.record.images import millimetres
from uav_bt.record.record_file import Timeline
from uav_bt.record.site_maps import note_of
from uav_bt.record.values import dump, encode
from uav_bt.tree.status import Status
from uav_bt.types import CameraModel, ClassMap, DepthMap, Frame
from uav_bt.types.camera import FrameNote

T = TypeVar("T")

# Board values with a separate channel, written when they are new.
_VALUES: Final = {
    keys.CORRIDOR.name: channels.CORRIDOR,
    keys.MARK.name: channels.MARK,
    keys.ADVICE.name: channels.ADVICE,
}
_MAP_S: Final = 0.5  # seconds between site maps, which change with every view
_SLACK_S: Final = 1e-6
_MAPS: Final = {
    keys.CLASS_MAP.name: channels.CLASS_MAP,
    keys.RELATIVE_DEPTH.name: channels.RELATIVE_DEPTH,
    keys.METRIC_DEPTH.name: channels.METRIC_DEPTH,
}
# Written completely to separate channels; of all others the board's message has the times.
_ELSEWHERE: Final = frozenset(
    key.name for key in (keys.FRAME, keys.STATE, keys.CAMERA, keys.RECENT_VIEWS, keys.ADVICE)
)
# Relative depth has no unit and compresses badly; smaller files omit it.
_LEFT_OUT: Final[dict[Quality, tuple[Channel, ...]]] = {
    "lossless": (),
    "high": (channels.RELATIVE_DEPTH,),
    "small": tuple(_MAPS.values()),
}

LogLine = tuple[str, str, str]
"""Level ("Info", "Warning" or "Error"), message, and name of the logger."""

Message = tuple[Channel, bytes | None]
"""An omitted message has no data."""


@dataclass(frozen=True, kw_only=True)
class RawMoment:
    """The data of a tick, immutable, as the flight hands it over."""

    tick: TickRecord
    commands: CommandNote
    board: dict[str, tuple[Any, float]]  # value and capture time by key
    statuses: tuple[Status, ...]  # statuses of all nodes
    log: tuple[LogLine, ...] = ()

    def value(self, key: str) -> Any:
        """Return a value of the board; None without one."""
        return self.board.get(key, (None, 0.0))[0]


class MomentEncoder:
    """Encodes moments in their order; each value only when it is new."""

    def __init__(self, timeline: Timeline, camera: CameraModel, quality: Quality) -> None:
        self._timeline = timeline
        self._camera = camera
        self._quality = quality
        self._last: dict[str, object] = {}  # the values written last
        self._map_s = -math.inf  # time of the last site map

    def encode(self, moment: RawMoment, *, images: bool) -> Iterator[Message]:
        """Yield a moment's messages; without `images` those have no data."""
        now_ns = self._timeline.at(moment.tick.time_s)
        for channel, value in self._values(moment):
            yield channel, dump(encode(value))
        words = _words(moment.tick)
        if self._is_new("words", words):
            yield channels.TREE_LOG, messages.log_line("Info", words, "tree", now_ns)
        for line in moment.log:
            yield channels.LOG, messages.log_line(*line, now_ns)
        yield from self._drawn(moment, now_ns)
        frame = moment.tick.observation.frame
        if frame is not None and self._is_new(keys.FRAME.name, frame.index):
            yield channels.CAMERA_FRAME, dump(encode(frame, FrameNote))
            yield channels.CAMERA_IMAGE, self._image(frame) if images else None
        for name, channel in _MAPS.items():
            value = moment.value(name)
            if self._is_new(name, value) and channel not in _LEFT_OUT[self._quality]:
                yield channel, self._image(value) if images else None

    def _values(self, moment: RawMoment) -> Iterator[tuple[Channel, object]]:
        tick, site_map = moment.tick, moment.value(keys.SITE_MAP.name)
        yield channels.TICK, TickNote.of(tick)
        yield channels.COMMANDS, moment.commands
        yield channels.STATE, tick.observation.state
        if self._is_new("statuses", moment.statuses):
            names = tuple(status.name for status in moment.statuses)
            yield channels.TREE_STATUS, StatusNote(statuses=names)
        if tick.truth is not None:
            yield channels.TRUTH, tick.truth
        board = {
            name: {"value": plain(value), "captured_s": captured_s}
            for name, (value, captured_s) in moment.board.items()
            if name not in _ELSEWHERE
        }
        yield channels.BOARD, board
        for name, channel in _VALUES.items():
            value = moment.value(name)
            if self._is_new(name, value):
                yield channel, value
        if site_map is None:
            return
        if self._is_new("near", site_map.near):
            yield channels.NEAR, site_map.near
        if tick.time_s - self._map_s >= _MAP_S - _SLACK_S and self._is_new("site_map", site_map):
            self._map_s = tick.time_s
            yield channels.SITE_MAP, note_of(site_map)

    def _is_new(self, name: str, value: object) -> bool:
        """Return whether there is a value, another than the last one of this name."""
        last = self._last.get(name)
        plain = isinstance(value, int | str | tuple)  # of others the arrays are not compared
        if value is None or value is last or (plain and value == last):
            return False
        self._last[name] = value
        return True

    def _drawn(self, moment: RawMoment, now_ns: int) -> Iterator[Message]:
        """Yield what only viewers read: poses and scenes."""
        truth, state = moment.tick.truth, moment.tick.observation.state
        if truth is None:
            return
        for transform in messages.transforms(
            truth.pose, state.attitude, state.gimbal_pitch_rad, self._camera, now_ns
        ):
            yield channels.TRANSFORM, transform
        corridor, fix = _fresh(moment, keys.CORRIDOR), _fresh(moment, keys.MARK)
        if corridor is not None or fix is not None:
            scene = messages.perceived_scene(truth.pose, corridor, fix, now_ns)
            yield channels.PERCEIVED, scene

    def _image(self, value: Frame | ClassMap | DepthMap) -> bytes:
        captured_ns = self._timeline.at(value.captured_s)
        if isinstance(value, Frame):
            return messages.camera_image(value.image, captured_ns, self._quality)
        if isinstance(value, ClassMap):
            return messages.raw(value.ids, captured_ns)
        return messages.raw(millimetres(value.depth) if value.metric else value.depth, captured_ns)


def _words(tick: TickRecord) -> str:
    """Return the phase, the active leaf and its reason."""
    leaf = tick.active[-1] if tick.active else "idle"
    why = f": {tick.feedback}" if tick.feedback else ""
    return f"{tick.phase or '-'}: {leaf}{why}"


def _fresh(moment: RawMoment, key: Key[T]) -> T | None:
    value, captured_s = moment.board.get(key.name, (None, 0.0))
    return value if moment.tick.time_s - captured_s <= key.max_age_s else None
