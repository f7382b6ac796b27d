"""The context of a mission that leaves get at setup, with its proposals, notes and folder."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, get_args

import numpy as np

from uav_bt.board.blackboard import Blackboard
from uav_bt.board.keys import ELAPSED, MISSION_KEYS
from uav_bt.clock import WallClock
from uav_bt.errors import FileError, ProposalConflictError
from uav_bt.files import check_empty_folder, write_whole, writing
from uav_bt.lab.classes import LabClasses
from uav_bt.lab.shipped import default_mark, load_lab
from uav_bt.plugins import make_policy
from uav_bt.protocols import Clock, LeafPolicy, Segmenter, Sight, StillCamera
from uav_bt.types import Airframe, Clearances, GimbalTo, LandingMark, Movement, Pose2D
from uav_bt.types.area import Area
from uav_bt.types.flight_results import EventKind, FlightEvent, Photo

_NAME: Final = re.compile(r"[A-Za-z0-9][\w.\-]{0,99}", re.ASCII)


class FlightFolder:
    """The output folder of one flight, new or empty; leaves may not use the reserved names.

    It is made with the first file.
    """

    def __init__(self, folder: Path, reserved: Iterable[str] = ()) -> None:
        check_empty_folder(folder, "a flight")
        self.folder = folder
        self._reserved = frozenset(reserved)

    def write(self, name: str, content: bytes | str) -> None:
        """Write a new file; a reader never sees half of it, and text becomes UTF-8."""
        path = self.folder / name
        if not _NAME.fullmatch(name):
            expected = "expected letters, digits, '_', '-' and '.', without folders"
            raise FileError(name, f"is no name of a file in the flight's folder: {expected}")
        if name in self._reserved:
            raise FileError(path, "is the name of another output of the flight; use another name")
        self.make()
        with writing(path):
            if path.exists() or path.is_symlink():
                raise FileError(path, "exists already; use another name")
        write_whole(path, content)

    def make(self) -> None:
        """Make the folder."""
        with writing(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)


_MAX_EVENTS: Final = 2000  # a leaf in a loop may report in every tick; chosen


class Proposals:
    """The proposals of the leaves in one tick; cleared before each tick."""

    def __init__(self) -> None:
        self.movement: Movement | None = None
        self.movement_owner: str | None = None  # path of the leaf that proposed it
        self.gimbal: GimbalTo | None = None
        self.gimbal_owner: str | None = None
        self._ended: set[str] = set()  # leaves that have ended in this tick
        self._next_id = 1

    def next_id(self) -> int:
        """Return a fresh id for a `MoveBy`."""
        self._next_id += 1
        return self._next_id - 1

    def clear(self) -> None:
        """Drop all proposals; ids continue."""
        self.movement = self.movement_owner = self.gimbal = self.gimbal_owner = None
        self._ended.clear()

    def propose(self, owner: str, movement: Movement) -> None:
        """Propose a movement; refused if a leaf that runs on has proposed one in this tick."""
        _check_type(movement, Movement, "a movement")
        self._check_free(self.movement_owner, owner, "a movement")
        self.movement, self.movement_owner = movement, owner

    def propose_gimbal(self, owner: str, gimbal: GimbalTo) -> None:
        """Propose a camera direction; refused as a second movement is."""
        _check_type(gimbal, GimbalTo, "a camera direction")
        self._check_free(self.gimbal_owner, owner, "a gimbal pitch")
        self.gimbal, self.gimbal_owner = gimbal, owner

    def _check_free(self, other: str | None, owner: str, what: str) -> None:
        if other not in {None, owner} and other not in self._ended:
            raise ProposalConflictError(
                f"leaves '{other}' and '{owner}' both propose {what} in one tick"
            )
        self._ended.discard(owner)

    def end(self, owner: str) -> None:
        """Let another leaf of this tick replace the proposals of a leaf that has ended, by path."""
        self._ended.add(owner)

    def withdraw(self, owner: str) -> None:
        """Take back the proposals of a leaf in this tick, by path."""
        if self.movement_owner == owner:
            self.movement = self.movement_owner = None
        if self.gimbal_owner == owner:
            self.gimbal = self.gimbal_owner = None


def _check_type(value: object, kind: Any, words: str) -> None:
    if not isinstance(value, kind):
        names = " or ".join(one.__name__ for one in get_args(kind) or (kind,))
        raise TypeError(f"expected {words} ({names}), got {value!r:.80}")


class FlightNotes:
    """Collects the events and photographs of one flight."""

    def __init__(self) -> None:
        self.events: list[FlightEvent] = []  # the first 2000, and one that says so
        self.photos: list[Photo] = []
        self._taken = 0
        self._photo = 0

    def add(self, event: FlightEvent) -> None:
        """Add an event."""
        if len(self.events) < _MAX_EVENTS:
            self.events.append(event)
        elif len(self.events) == _MAX_EVENTS:
            text = f"the flight has more than {_MAX_EVENTS} events: further ones are not kept"
            self.events.append(FlightEvent(time_s=event.time_s, kind=EventKind.WARNING, text=text))

    def next_photo(self) -> int:
        """Return the number of the next photograph, from 1. A failed one keeps its number."""
        self._photo += 1
        return self._photo

    def told(self) -> dict[str, str]:
        """Return the failures that leaves have told of since the last `take`, by path."""
        kinds = (EventKind.FAILED, EventKind.NO_PHOTO)
        return {one.node: one.text for one in self.events[self._taken :] if one.kind in kinds}

    def take(self) -> tuple[FlightEvent, ...]:
        """Return the events since the last call."""
        new = tuple(self.events[self._taken :])
        self._taken = len(self.events)
        return new


@dataclass(frozen=True, kw_only=True)
class MissionContext:
    """The context of one mission, passed to every leaf's `on_setup`."""

    # The mission's time; default: seconds since the context was made
    clock: Clock = field(default_factory=WallClock)
    # The mission board; default: an empty one with the mission keys
    board: Blackboard = None  # type: ignore[assignment]  # made below, with the clock
    proposals: Proposals = field(default_factory=Proposals)  # the proposals of the present tick
    # Returns a leaf policy by its registered name, or raises `UnknownNameError`
    policy: Callable[[str], LeafPolicy] = make_policy
    seed: int = 0  # of all random numbers in leaves
    # Threads of the networks' inference; one in a campaign, so that results do not depend on the
    # load
    inference_threads: int = 1
    # Replaces the network of every Segment leaf, for flights on exact masks
    segmenter: Segmenter | None = None
    # Perception of a drone without images; replaces networks and optical flow
    sight: Sight | None = None
    stills: StillCamera | None = None  # the drone's own photographs; None if it takes none
    # Classes of the lab. Default: those of the paper's lab.
    classes: LabClasses = field(default_factory=lambda: load_lab().classes)
    ground: tuple[str, ...] = ()  # names of further classes that count as ground
    airframe: Airframe = field(default_factory=Airframe)  # size and reaction of the drone's body
    # Landing mark. Default: that of the default lab.
    mark: LandingMark = field(default_factory=default_mark)
    clearances: Clearances = field(default_factory=Clearances)  # distances that routes keep
    # Take-off pose in the lab's drawing, yaw counter-clockwise; None if unknown
    take_off: Pose2D | None = None
    # Pose of the mark there, yaw counter-clockwise; None if unknown
    mark_pose: Pose2D | None = None
    area: Area | None = None  # area that the mission stays in; None: no bound
    # Duration of each perception stage, seconds by stage name
    stage_times_s: dict[str, list[float]] = field(default_factory=dict)
    notes: FlightNotes = field(default_factory=FlightNotes)  # events and photographs of the flight
    # Folder that leaves write files to; None if the flight has none
    outputs: FlightFolder | None = None

    def __post_init__(self) -> None:
        if self.board is None:
            object.__setattr__(self, "board", Blackboard(self.clock, MISSION_KEYS))

    def rng(self, owner: str) -> np.random.Generator:
        """Return a generator that depends on the mission's seed and the owner's name only."""
        return np.random.default_rng([self.seed, *owner.encode()])

    def add_event(self, kind: EventKind, text: str, node: str = "") -> None:
        """Add an event of this moment to the flight's notes; `node` is the path of its node."""
        elapsed_s = self.board.read(ELAPSED).value or 0.0
        self.notes.add(FlightEvent(time_s=round(elapsed_s, 3), kind=kind, text=text, node=node))

    def warn_once(self, text: str, node: str) -> None:
        """Add a warning to the flight's notes, unless the node has given it before."""
        if all((event.text, event.node) != (text, node) for event in self.notes.events):
            self.add_event(EventKind.WARNING, text, node)


NO_CONTEXT: Final = """\
setup needs the mission's surroundings; in a plain py_trees tree:
  from uav_bt.board import MissionContext
  behaviour_tree.setup(mission=MissionContext())"""
