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
from uav_bt.record import channels, messages, scenes
from uav_bt.record.channels import Channel, CommandNote, FrameNote, StatusNote, TickNote
from uav_bt.record.config import Quality
from uav_bt.record.images import millimetres
from uav_bt.record.record_file import Timeline
from uav_bt.record.site_maps import note_of
from uav_bt.record.values import dump, encode, finite
from uav_bt.record.worker import Encoded
from uav_bt.tree.status import Status
from uav_bt.types import CameraModel, ClassMap, DepthMap, GimbalTo, Movement, NearObstacles

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
# Written completely to separate channels, recent views as the frames of their ticks; of all others
# the board's message has capture times.
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


@dataclass(frozen=True, kw_only=True)
class RawMoment:
    """The data of a tick, immutable, as the flight hands it over."""

    tick: TickRecord
    proposed: Movement | None
    proposed_gimbal: GimbalTo | None
    board: dict[str, tuple[Any, float]]  # value and capture time by key
    statuses: tuple[Status, ...]  # statuses of all nodes
    log: tuple[LogLine, ...] = ()


class MomentEncoder:
    """Encodes moments in their order; each value only when it is new."""

    def __init__(self, timeline: Timeline, camera: CameraModel, quality: Quality) -> None:
        self._timeline = timeline
        self._camera = camera
        self._quality = quality
        self._frame_index: int | None = None
        self._last: dict[str, Any] = {}  # the board values written last
        self._statuses: tuple[Status, ...] | None = None
        self._map_s = -math.inf  # time of the last site map
        self._near: NearObstacles | None = None  # the value written last
        self._words = ""  # the active leaf and its reason, written last

    def encode(self, moment: RawMoment, images: bool) -> Iterator[Encoded]:  # noqa: FBT001 - called by the worker
        """Yield a moment's messages; without `images` their channels are named without data."""
        now_ns = self._timeline.at(moment.tick.time_s)

        def message(channel: Channel, data: bytes | None) -> Encoded:
            return Encoded(channel=channel, time_ns=now_ns, data=data)

        yield message(channels.TICK, dump(encode(TickNote.of(moment.tick))))
        yield message(channels.COMMANDS, dump(encode(_commands(moment))))
        yield message(channels.STATE, dump(encode(moment.tick.observation.state)))
        if moment.statuses != self._statuses:
            self._statuses = moment.statuses
            statuses = StatusNote(statuses=tuple(status.name for status in moment.statuses))
            yield message(channels.TREE_STATUS, dump(encode(statuses)))
        words = _words(moment.tick)
        if words != self._words:
            self._words = words
            yield message(channels.TREE_LOG, messages.log_line("Info", words, "tree", now_ns))
        for channel, data in self._truth(moment, now_ns):
            yield message(channel, data)
        board = {
            name: {"value": finite(plain(value)), "captured_s": finite(captured_s)}
            for name, (value, captured_s) in moment.board.items()
            if name not in _ELSEWHERE
        }
        yield message(channels.BOARD, dump(board))
        for line in moment.log:
            yield message(channels.LOG, messages.log_line(*line, now_ns))
        for channel, value in self._values(moment):
            yield message(channel, dump(encode(value)))
        for channel, image in self._frame(moment.tick, images=images):
            yield message(channel, image)
        for name, channel in _MAPS.items():
            if self._is_new(name, moment) and channel not in _LEFT_OUT[self._quality]:
                value = moment.board[name][0]
                yield message(channel, self._map(value) if images else None)

    def _is_new(self, name: str, moment: RawMoment) -> bool:
        value, _ = moment.board.get(name, (None, 0.0))
        if value is None or value is self._last.get(name):
            return False
        self._last[name] = value
        return True

    def _values(self, moment: RawMoment) -> Iterator[tuple[Channel, object]]:
        for name, channel in _VALUES.items():
            if self._is_new(name, moment):
                yield channel, moment.board[name][0]
        time_s, site_map = moment.tick.time_s, keys.SITE_MAP.name
        value, _ = moment.board.get(site_map, (None, 0.0))
        if value is not None and value.near is not self._near:
            self._near = value.near
            yield channels.NEAR, value.near
        if time_s - self._map_s >= _MAP_S - _SLACK_S and self._is_new(site_map, moment):
            self._map_s = time_s
            yield channels.SITE_MAP, note_of(moment.board[site_map][0])

    def _truth(self, moment: RawMoment, now_ns: int) -> Iterator[tuple[Channel, bytes]]:
        truth, state = moment.tick.truth, moment.tick.observation.state
        if truth is None:
            return
        yield channels.TRUTH, dump(encode(truth))
        yield channels.POSE, messages.pose(truth.pose, state.attitude, now_ns)
        for transform in messages.transforms(
            truth.pose, state.attitude, state.gimbal_pitch_rad, self._camera, now_ns
        ):
            yield channels.TRANSFORM, transform
        corridor, fix = _fresh(moment, keys.CORRIDOR), _fresh(moment, keys.MARK)
        if corridor is not None or fix is not None:
            scene = scenes.perceived_scene(truth.pose, corridor, fix, now_ns)
            yield channels.PERCEIVED, scene

    def _frame(self, tick: TickRecord, *, images: bool) -> Iterator[tuple[Channel, bytes | None]]:
        frame = tick.observation.frame
        if frame is None or frame.index == self._frame_index:
            return
        self._frame_index = frame.index
        yield channels.CAMERA_FRAME, dump(encode(FrameNote.of(frame)))
        captured_ns = self._timeline.at(frame.captured_s)
        image = messages.camera_image(frame.image, captured_ns, self._quality) if images else None
        yield channels.CAMERA_IMAGE, image

    def _map(self, value: ClassMap | DepthMap) -> bytes:
        captured_ns = self._timeline.at(value.captured_s)
        if isinstance(value, ClassMap):
            return messages.raw(value.ids, captured_ns)
        return messages.raw(millimetres(value.depth) if value.metric else value.depth, captured_ns)


def _commands(moment: RawMoment) -> CommandNote:
    tick = moment.tick
    return CommandNote(
        proposed=moment.proposed,
        proposed_by=tick.proposed_by,
        proposed_gimbal=moment.proposed_gimbal,
        decided=tick.decided or tick.command,
        sent=tick.command,
        override=None if tick.override is None else tick.override.value,
    )


def _words(tick: TickRecord) -> str:
    """Return the phase, the active leaf and its reason."""
    leaf = tick.active[-1] if tick.active else "idle"
    why = f": {tick.feedback}" if tick.feedback else ""
    return f"{tick.phase or '-'}: {leaf}{why}"


def _fresh(moment: RawMoment, key: Key[T]) -> T | None:
    value, captured_s = moment.board.get(key.name, (None, 0.0))
    return value if moment.tick.time_s - captured_s <= key.max_age_s else None
