"""What a record notes of a tick, beside the values that the board has."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from uav_bt.mission.runner import TickRecord
from uav_bt.types import Attitude, Command, Frame, GimbalTo, Movement


@dataclass(frozen=True, kw_only=True)
class TickNote:
    """A tick of the runner."""

    index: int
    time_s: float  # of the mission clock, exactly
    tree_status: str
    phase: str = ""
    active: tuple[str, ...] = ()  # names from the root to the deepest running node
    word: str = ""  # feedback of the deepest running node
    compute_s: float = 0.0  # wall time of the tree, networks included
    frame_index: int | None = None  # of the newest frame then; None before the first
    slow_leaves: tuple[str, ...] = ()  # that blocked

    @classmethod
    def of(cls, record: TickRecord) -> TickNote:
        """Return the note of a tick."""
        frame = record.observation.frame
        return cls(
            index=record.index,
            time_s=record.time_s,
            tree_status=record.tree_status.name,
            phase=record.phase,
            active=record.active,
            word=record.word,
            compute_s=record.compute_s,
            frame_index=None if frame is None else frame.index,
            slow_leaves=tuple(slow.path for slow in record.slow),
        )


@dataclass(frozen=True, kw_only=True)
class CommandNote:
    """What the leaves proposed in a tick, what the arbiter made of it, what was sent."""

    proposed: Movement | None = None
    proposed_by: str | None = None  # the leaf's path
    proposed_gimbal: GimbalTo | None = None
    decided: Command
    sent: Command  # after the drone's own limits
    override: str | None = None  # why the leaves were not asked


@dataclass(frozen=True, kw_only=True)
class FrameNote:
    """A camera frame without its image."""

    index: int
    captured_s: float
    gimbal_pitch_rad: float
    attitude: Attitude = field(default_factory=Attitude)
    altitude_m: float = 0.0  # above the take-off point
    height_m: float = 0.0  # above the surface below
    height_above_carpet_m: float = 0.0

    @classmethod
    def of(cls, frame: Frame) -> FrameNote:
        """Return the note of a frame."""
        return cls(**{item.name: getattr(frame, item.name) for item in fields(cls)})

    def with_image(self, image: NDArray[np.uint8]) -> Frame:
        """Return the frame again.

        Args:
            image: (H, W, 3), RGB.
        """
        return Frame(image=image, **{item.name: getattr(self, item.name) for item in fields(self)})


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


@dataclass(frozen=True, kw_only=True)
class StatusNote:
    """How the nodes stand after a tick, in the order of `TreeNote`."""

    statuses: tuple[str, ...]
