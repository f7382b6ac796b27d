"""The notes of a tick, and the channels of a record (docs/records.md)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from uav_bt import types
from uav_bt.errors import ValueRangeError
from uav_bt.mission.safety import Override
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import Advice
from uav_bt.record.values import dump, json_schema
from uav_bt.types.camera import FrameNote
from uav_bt.types.site_map import SiteMapBase

_MAX_TIME_S: Final = 1e9  # views count nanoseconds in 64 bits
_SAME: Final = ("index", "time_s", "phase", "active", "compute_s")  # of a tick and its note


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
    frame_index: int | None = None  # of the newest frame
    slow_leaves: tuple[str, ...] = ()  # leaves that exceeded their time budget

    def __post_init__(self) -> None:
        if not (abs(self.time_s) < _MAX_TIME_S and self.index >= 0):
            raise ValueRangeError(f"tick {self.index} at {self.time_s} s is none")

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
    """What was proposed, decided and sent in one tick."""

    proposed: types.Movement | None = None
    proposed_by: str | None = None  # the leaf's path
    proposed_gimbal: types.GimbalTo | None = None
    decided: types.Command
    sent: types.Command  # command after the drone's limits
    override: Override | None = None  # the safety rule that replaced the proposal


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


# Readers refuse any other version. New channels and fields keep it; a change raises it.
SCHEMA_VERSION: Final = 3

# Names of the metadata at the start and at the end of the flight.
START: Final = "uav_bt.flight"
END: Final = "uav_bt.end"


class Channel(NamedTuple):
    """One channel."""

    topic: str
    # A message type of Foxglove's, a dataclass (JSON), or None: any JSON.
    content: str | type[Any] | None

    @property
    def schema_name(self) -> str:
        """Name of the schema in the file."""
        if isinstance(self.content, str):
            return f"foxglove.{self.content}"
        name = "Board" if self.content is None else self.content.__name__
        return f"uav_bt.{name.removesuffix('Note')}"

    def schema(self) -> tuple[str, str, bytes]:
        """Return the encodings of messages and schema, and the schema."""
        if isinstance(self.content, str):
            from foxglove import messages  # noqa: PLC0415 - an extra

            schema = getattr(messages, self.content).get_schema()
            return "protobuf", str(schema.encoding), bytes(schema.data)
        if self.content is None:
            return "json", "jsonschema", dump({"title": "Board", "type": "object"})
        return "json", "jsonschema", json_schema(self.content)


CHANNELS: Final[dict[str, Channel]] = {}


def _channel(topic: str, content: str | type[Any] | None) -> Channel:
    CHANNELS[topic] = Channel(topic, content)
    return CHANNELS[topic]


CAMERA_IMAGE: Final = _channel("/camera/image", "CompressedImage")
CAMERA_FRAME: Final = _channel("/camera/frame", FrameNote)
CALIBRATION: Final = _channel("/camera/calibration", "CameraCalibration")
CLASS_MAP: Final = _channel("/perception/class_map", "RawImage")
RELATIVE_DEPTH: Final = _channel("/perception/relative_depth", "RawImage")
METRIC_DEPTH: Final = _channel("/perception/metric_depth", "RawImage")
CORRIDOR: Final = _channel("/perception/corridor", types.Corridor)
MARK: Final = _channel("/perception/mark", types.MarkFix)
NEAR: Final = _channel("/perception/obstacles", types.NearObstacles)  # `near` of the site map
SITE_MAP: Final = _channel("/perception/site_map", SiteMapNote)
STATE: Final = _channel("/drone/state", types.DroneState)
TRANSFORM: Final = _channel("/tf", "FrameTransform")
TRUTH: Final = _channel("/drone/truth", types.Truth)
TICK: Final = _channel("/mission/tick", TickNote)
COMMANDS: Final = _channel("/mission/commands", CommandNote)
BOARD: Final = _channel("/mission/board", None)
ADVICE: Final = _channel("/mission/advice", Advice)
TREE: Final = _channel("/tree/nodes", TreeNote)
TREE_STATUS: Final = _channel("/tree/status", StatusNote)
LOG: Final = _channel("/log", "Log")
TREE_LOG: Final = _channel("/tree/log", "Log")
LAB: Final = _channel("/scene/lab", "SceneUpdate")
PERCEIVED: Final = _channel("/scene/perceived", "SceneUpdate")
