"""The channels of a record: what they are called, and what is on them.

`docs/records.md` lists them for people. A new channel or a new field is no new version; a change
of what is there is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from uav_bt.protocols import Advice
from uav_bt.record.notes import CommandNote, FrameNote, StatusNote, TickNote, TreeNote
from uav_bt.record.values import dump, json_schema
from uav_bt.types import Corridor, DroneState, HelipadFix, ObstaclePoints, Truth

SCHEMA_VERSION: Final = 1  # of the whole record; readers refuse a newer one

# Names of the two metadata records: what was known when the flight began, and when it had ended.
START: Final = "uav_bt.flight"
END: Final = "uav_bt.end"


@dataclass(frozen=True, kw_only=True)
class Channel:
    """One channel."""

    topic: str
    # A message type of Foxglove's (protobuf), a dataclass (JSON), or None: JSON of any shape.
    content: str | type[Any] | None
    image: bool = False  # large: left out first when the disk is too slow

    @property
    def schema_name(self) -> str:
        """What the schema is called in the file."""
        if isinstance(self.content, str):
            return f"foxglove.{self.content}"
        name = "Board" if self.content is None else self.content.__name__
        return f"uav_bt.{name.removesuffix('Note')}"

    @property
    def encoding(self) -> str:
        """How messages are encoded."""
        return "protobuf" if isinstance(self.content, str) else "json"


CAMERA_IMAGE: Final = Channel(topic="/camera/image", content="CompressedImage", image=True)
CAMERA_FRAME: Final = Channel(topic="/camera/frame", content=FrameNote)
CALIBRATION: Final = Channel(topic="/camera/calibration", content="CameraCalibration")
CLASS_MAP: Final = Channel(topic="/perception/class_map", content="RawImage", image=True)
RELATIVE_DEPTH: Final = Channel(topic="/perception/relative_depth", content="RawImage", image=True)
METRIC_DEPTH: Final = Channel(topic="/perception/metric_depth", content="RawImage", image=True)
CORRIDOR: Final = Channel(topic="/perception/corridor", content=Corridor)
HELIPAD: Final = Channel(topic="/perception/helipad", content=HelipadFix)
OBSTACLES: Final = Channel(topic="/perception/obstacles", content=ObstaclePoints)
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

CHANNELS: Final[dict[str, Channel]] = {
    channel.topic: channel
    for channel in (
        *(CAMERA_IMAGE, CAMERA_FRAME, CALIBRATION),
        *(CLASS_MAP, RELATIVE_DEPTH, METRIC_DEPTH, CORRIDOR, HELIPAD, OBSTACLES),
        *(STATE, POSE, TRANSFORM, TRUTH),
        *(TICK, COMMANDS, BOARD, ADVICE, TREE, TREE_STATUS, LOG),
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
