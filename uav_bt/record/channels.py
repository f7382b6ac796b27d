"""The content of a record: the notes of a tick, and the channels.

`docs/records.md` lists the channels. New channels and new fields keep the schema version; a
change of an existing one raises it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ValueRangeError
from uav_bt.mission.safety import Override
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import Advice
from uav_bt.record.values import dump, json_schema
from uav_bt.tree.status import Status
from uav_bt.types import (
    Attitude,
    Command,
    Corridor,
    DroneState,
    Frame,
    GimbalTo,
    MarkFix,
    Movement,
    NearObstacles,
    Truth,
)
from uav_bt.types.site_map import SiteMapBase

_STATUSES: Final = frozenset(Status.__members__)
_MAX_TIME_S: Final = 1e9  # views count nanoseconds in 64 bits
_SAME: Final = ("index", "time_s", "phase", "active", "compute_s")  # of a tick and its note
_OVERRIDES: Final = frozenset({None, *(override.value for override in Override)})


def _check_statuses(*statuses: str) -> None:
    unknown = set(statuses) - _STATUSES
    if unknown:
        raise ValueRangeError(f"unknown node status '{min(unknown):.40}'")


@dataclass(frozen=True, kw_only=True)
class TickNote:
    """A tick of the runner."""

    index: int
    time_s: float  # exact time of the mission clock
    tree_status: str
    phase: str = ""
    active: tuple[str, ...] = ()  # names from the root to the deepest running node
    word: str = ""  # feedback of the deepest running node
    compute_s: float = 0.0  # wall time of the tree, networks included
    frame_index: int | None = None  # index of the newest frame; None before the first
    slow_leaves: tuple[str, ...] = ()  # leaves that exceeded their time budget

    def __post_init__(self) -> None:
        if not (abs(self.time_s) < _MAX_TIME_S and self.index >= 0):
            raise ValueRangeError(f"tick {self.index} at {self.time_s} s is none")
        _check_statuses(self.tree_status)

    @classmethod
    def of(cls, record: TickRecord) -> TickNote:
        """Return the note of a tick."""
        frame = record.observation.frame
        return cls(
            **{name: getattr(record, name) for name in _SAME},
            tree_status=record.tree_status.name,
            word=record.feedback,
            frame_index=None if frame is None else frame.index,
            slow_leaves=tuple(slow.path for slow in record.slow),
        )


@dataclass(frozen=True, kw_only=True)
class CommandNote:
    """Proposal of the leaves, decision of the arbiter and command sent, in one tick."""

    proposed: Movement | None = None
    proposed_by: str | None = None  # the leaf's path
    proposed_gimbal: GimbalTo | None = None
    decided: Command
    sent: Command  # command after the drone's limits
    override: str | None = None  # the safety rule that replaced the proposal

    def __post_init__(self) -> None:
        if self.override not in _OVERRIDES:
            raise ValueRangeError(f"unknown safety rule '{self.override:.40}'")


@dataclass(frozen=True, kw_only=True)
class FrameNote:
    """A camera frame without its image."""

    index: int
    captured_s: float
    gimbal_pitch_rad: float
    attitude: Attitude = field(default_factory=Attitude)
    altitude_m: float = 0.0  # altitude above the take-off point
    height_m: float = 0.0  # height above the surface below
    height_above_ground_m: float = 0.0

    @classmethod
    def of(cls, frame: Frame) -> FrameNote:
        """Return the note of a frame."""
        return cls(**{item.name: getattr(frame, item.name) for item in fields(cls)})

    def with_image(self, image: NDArray[np.uint8]) -> Frame:
        """Return the frame with its image, (H, W, 3) RGB."""
        return Frame(image=image, **{item.name: getattr(self, item.name) for item in fields(self)})


@dataclass(frozen=True, kw_only=True, eq=False)
class SiteMapNote(SiteMapBase):
    """A `uav_bt.types.site_map.SiteMap` with its grids as one image."""

    cells_png: str  # base64; one byte per cell, one bit per grid


@dataclass(frozen=True, kw_only=True)
class NodeNote:
    """A node of the tree."""

    path: str
    name: str
    node_id: str  # its class in the tree file
    parent: int | None  # its place in the list of nodes; None for the root


@dataclass(frozen=True, kw_only=True)
class TreeNote:
    """The tree's nodes, parents first, in the order of the file."""

    nodes: tuple[NodeNote, ...]

    def __post_init__(self) -> None:
        for place, node in enumerate(self.nodes):
            if node.parent is not None and not 0 <= node.parent < place:
                raise ValueRangeError(f"node {place} must come after its parent, {node.parent}")


@dataclass(frozen=True, kw_only=True)
class StatusNote:
    """The nodes' statuses after a tick, in the order of `TreeNote`."""

    statuses: tuple[str, ...]

    def __post_init__(self) -> None:
        _check_statuses(*self.statuses)


SCHEMA_VERSION: Final = 3  # version of the whole record; readers refuse any other

# Names of the two metadata records, written at the start and at the end of the flight.
START: Final = "uav_bt.flight"
END: Final = "uav_bt.end"


@dataclass(frozen=True, kw_only=True)
class Channel:
    """One channel."""

    topic: str
    # A message type of Foxglove's (protobuf), a dataclass (JSON), or None: JSON of any shape.
    content: str | type[Any] | None
    image: bool = False  # large: omitted first when the disk is too slow

    @property
    def schema_name(self) -> str:
        """Name of the schema in the file."""
        if isinstance(self.content, str):
            return f"foxglove.{self.content}"
        name = "Board" if self.content is None else self.content.__name__
        return f"uav_bt.{name.removesuffix('Note')}"

    @property
    def encoding(self) -> str:
        """Encoding of the messages."""
        return "protobuf" if isinstance(self.content, str) else "json"


CAMERA_IMAGE: Final = Channel(topic="/camera/image", content="CompressedImage", image=True)
CAMERA_FRAME: Final = Channel(topic="/camera/frame", content=FrameNote)
CALIBRATION: Final = Channel(topic="/camera/calibration", content="CameraCalibration")
CLASS_MAP: Final = Channel(topic="/perception/class_map", content="RawImage", image=True)
RELATIVE_DEPTH: Final = Channel(topic="/perception/relative_depth", content="RawImage", image=True)
METRIC_DEPTH: Final = Channel(topic="/perception/metric_depth", content="RawImage", image=True)
CORRIDOR: Final = Channel(topic="/perception/corridor", content=Corridor)
MARK: Final = Channel(topic="/perception/mark", content=MarkFix)
# `near` of the site map, in every tick.
NEAR: Final = Channel(topic="/perception/obstacles", content=NearObstacles)
SITE_MAP: Final = Channel(topic="/perception/site_map", content=SiteMapNote)
STATE: Final = Channel(topic="/drone/state", content=DroneState)
POSE: Final = Channel(topic="/drone/pose", content="PoseInFrame")
TRANSFORM: Final = Channel(topic="/tf", content="FrameTransform")
TRUTH: Final = Channel(topic="/drone/truth", content=Truth)
TICK: Final = Channel(topic="/mission/tick", content=TickNote)
COMMANDS: Final = Channel(topic="/mission/commands", content=CommandNote)
BOARD: Final = Channel(topic="/mission/board", content=None)
ADVICE: Final = Channel(topic="/mission/advice", content=Advice)
TREE: Final = Channel(topic="/tree/nodes", content=TreeNote)
TREE_STATUS: Final = Channel(topic="/tree/status", content=StatusNote)
LOG: Final = Channel(topic="/log", content="Log")
TREE_LOG: Final = Channel(topic="/tree/log", content="Log")
LAB: Final = Channel(topic="/scene/lab", content="SceneUpdate")
PERCEIVED: Final = Channel(topic="/scene/perceived", content="SceneUpdate")

CHANNELS: Final[dict[str, Channel]] = {
    channel.topic: channel
    for channel in (
        *(CAMERA_IMAGE, CAMERA_FRAME, CALIBRATION),
        *(CLASS_MAP, RELATIVE_DEPTH, METRIC_DEPTH, CORRIDOR, MARK, NEAR, SITE_MAP),
        *(STATE, POSE, TRANSFORM, TRUTH),
        *(TICK, COMMANDS, BOARD, ADVICE, TREE, TREE_STATUS, LOG),
        *(TREE_LOG, LAB, PERCEIVED),
    )
}


def schema_of(channel: Channel) -> tuple[str, bytes]:
    """Return a channel's schema: its encoding and its bytes."""
    if isinstance(channel.content, str):
        from foxglove import messages  # noqa: PLC0415 - an extra

        schema = getattr(messages, channel.content).get_schema()
        return str(schema.encoding), bytes(schema.data)
    if channel.content is None:
        return "jsonschema", dump({"title": "Board", "type": "object"})
    return "jsonschema", json_schema(channel.content)
