"""One tick of a record, decoded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from uav_bt import types
from uav_bt.errors import InputError
from uav_bt.files import parse_json
from uav_bt.lab.classes import LabClasses
from uav_bt.record import channels
from uav_bt.record.channels import Channel, CommandNote, TickNote
from uav_bt.record.images import decode_image, image_bytes, raw_image
from uav_bt.record.site_maps import site_map_of
from uav_bt.record.values import decode, decode_float
from uav_bt.tree.status import Status
from uav_bt.types.camera import FrameNote
from uav_bt.types.site_map import SiteMap


@dataclass(frozen=True, kw_only=True)
class StoredFrame:
    """A camera frame whose image is decoded on access."""

    note: FrameNote
    image: bytes | None  # a PNG or a JPEG; None if it was omitted

    def frame(self) -> types.Frame:
        """Return the frame as the drone sent it; InputError if its image is none."""
        if self.image is None:
            raise InputError(
                f"the record has no image of frame {self.note.index}: the disk was too slow then"
            )
        return types.Frame(image=decode_image(self.image), **vars(self.note))


@dataclass(frozen=True, kw_only=True)
class Moment:
    """One tick. A field is None if it is missing or has no new value in this tick."""

    tick: TickNote
    commands: CommandNote
    state: types.DroneState
    statuses: tuple[str, ...]  # statuses of all nodes, in the order of `RecordReader.tree`
    board: Mapping[str, Any] = field(default_factory=dict)  # {key: {"value", "captured_s"}}
    frame: StoredFrame | None = None
    class_map: types.ClassMap | None = None
    relative_depth: types.DepthMap | None = None
    metric_depth: types.DepthMap | None = None  # whole millimetres; NaN where unknown
    corridor: types.Corridor | None = None
    mark: types.MarkFix | None = None
    near: types.NearObstacles | None = None  # near obstacles of the site map
    site_map: SiteMap | None = None  # kept at most twice a second
    truth: types.Truth | None = None


def moment_of(found: Mapping[str, bytes], statuses: tuple[str, ...], classes: LabClasses) -> Moment:
    """Return the moment of a tick's messages by topic.

    `statuses` are those of the nodes after the previous tick.
    """

    def value(channel: Channel) -> Any:
        if channel.topic not in found or not isinstance(channel.content, type):
            return None
        return decode(channel.content, parse_json(found[channel.topic]))

    tick, commands, state = map(value, (channels.TICK, channels.COMMANDS, channels.STATE))
    if tick is None or commands is None or state is None:
        raise InputError("a tick of the record lacks its commands or its state")
    status, site_map = value(channels.TREE_STATUS), value(channels.SITE_MAP)
    statuses = statuses if status is None else status.statuses
    unknown = {tick.tree_status, *statuses} - Status.__members__.keys()
    if unknown:
        raise InputError(f"unknown node status '{min(unknown):.40}'")
    note, board = value(channels.CAMERA_FRAME), _board(found)
    image = found.get(channels.CAMERA_IMAGE.topic)
    class_map = None
    if channels.CLASS_MAP.topic in found:
        ids = raw_image(found[channels.CLASS_MAP.topic])
        class_map = types.ClassMap(
            ids=ids, classes=classes, captured_s=board["class_map"]["captured_s"]
        )
    return Moment(
        tick=tick,
        commands=commands,
        state=state,
        statuses=statuses,
        board=board,
        frame=note and StoredFrame(note=note, image=None if image is None else image_bytes(image)),
        class_map=class_map,
        relative_depth=_depth(found.get(channels.RELATIVE_DEPTH.topic), board, "relative_depth"),
        metric_depth=_depth(found.get(channels.METRIC_DEPTH.topic), board, "metric_depth"),
        corridor=value(channels.CORRIDOR),
        mark=value(channels.MARK),
        near=value(channels.NEAR),
        site_map=site_map and site_map_of(site_map, classes),
        truth=value(channels.TRUTH),
    )


def _board(found: Mapping[str, bytes]) -> dict[str, Any]:
    """Return the board's entries, each with value and capture time."""
    board = parse_json(found.get(channels.BOARD.topic, b"{}"))
    try:
        return {
            key: {"value": entry["value"], "captured_s": decode_float(entry["captured_s"])}
            for key, entry in board.items()
        }
    except (AttributeError, LookupError, TypeError) as error:
        raise InputError(f"expected the board's values and times, got {board!s:.80}") from error


def _depth(message: bytes | None, board: Mapping[str, Any], key: str) -> types.DepthMap | None:
    if message is None:
        return None
    pixels, entry = raw_image(message), board[key]
    metric = pixels.dtype == np.uint16
    depth = np.where(pixels > 0, pixels / np.float32(1000.0), np.nan) if metric else pixels
    return types.DepthMap(
        depth=depth.astype(np.float32),
        metric=metric,
        captured_s=entry["captured_s"],
        confidence=decode_float(entry["value"]["confidence"]),
    )
