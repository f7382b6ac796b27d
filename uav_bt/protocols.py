"""The interfaces of the system: drone, referee, clock, cameras, network, policy and progress."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from uav_bt.answers import Answer
from uav_bt.lab.classes import LabClasses
from uav_bt.landing_marks import MarkSighting
from uav_bt.types import (
    Airframe,
    CameraModel,
    ClassMap,
    Clearances,
    Command,
    Corridor,
    DepthMap,
    Frame,
    LandingMark,
    Observation,
    Pose2D,
    RecentViews,
    Truth,
)
from uav_bt.types.ground import Ground
from uav_bt.types.site_map import SiteMap

Advance = Callable[[str, int, int], None]
"""Progress of long work: the stage's name, the steps done and the total number of steps."""


def silent(_stage: str, _done: int, _total: int) -> None:
    """Report no progress."""


@runtime_checkable
class Clock(Protocol):
    """The mission's time, seconds."""

    def now(self) -> float:
        """Return the present time."""

    def sleep_until(self, time_s: float) -> None:
        """Wait until a time (in the twin: step the physics up to it)."""


@runtime_checkable
class Scene(Protocol):
    """The scene of a simulated drone."""

    @property
    def name(self) -> str:
        """Name in reports."""

    @property
    def mark(self) -> LandingMark | None:
        """Size of the landing mark; None without one."""

    @property
    def mark_pose(self) -> Pose2D | None:
        """Pose of the mark in the scene's drawing, yaw counter-clockwise; None without one."""

    @property
    def lab(self) -> str:
        """Name or path of the lab that the scene belongs to."""

    @property
    def classes(self) -> LabClasses:
        """Classes of that lab."""

    @property
    def take_off_pose(self) -> Pose2D | None:
        """Take-off pose in the scene's drawing, yaw counter-clockwise; None where it is random."""


@runtime_checkable
class Drone(Protocol):
    """A drone, real or simulated. Nothing external happens before `connect`."""

    @property
    def clock(self) -> Clock:
        """The clock that the whole mission uses."""

    @property
    def camera(self) -> CameraModel:
        """The camera's intrinsics at the size of the frames it sends."""

    @property
    def referee(self) -> Referee | None:
        """The truth of a simulation; None on a real drone."""

    @property
    def scene(self) -> Scene | None:
        """Scene of a simulated drone; None on a real drone."""

    @property
    def live(self) -> bool:
        """Whether battery, link, telemetry and video are checked before take-off."""

    @property
    def tick_s(self) -> float | None:
        """Length of a tick, seconds, if the drone sets the pace; else None."""

    @property
    def airframe(self) -> Airframe:
        """Size and reaction of the body; `Airframe()` without better numbers."""

    def connect(self) -> None:
        """Connect to the drone; DroneError if it cannot be reached."""

    def observe(self) -> Observation:
        """Return the newest frame and state; never blocks."""

    def send(self, command: Command) -> Command:
        """Send a command; return the one sent after the drone's limits."""

    def disconnect(self) -> None:
        """Disconnect; safe to call twice."""


class DroneConfig(Protocol):
    """Configuration dataclass of one kind of drone, registered in `uav_bt.drones`.

    Its fields are the settings of that drone, keyword-only and with defaults. Fields named as
    in `uav_bt/app/drone_of_flight.py` are filled in from a flight's options and its place.
    """

    def create(self) -> Drone:
        """Return an unconnected drone; InputError if these settings make none."""


@runtime_checkable
class Referee(Protocol):
    """The truth of a simulation, for reports and evaluations only."""

    def truth(self) -> Truth:
        """Return the present truth."""

    def ground(self) -> Ground | None:
        """Return the ground of the scene; None if unknown, then coverage is not measured."""

    def class_ids(self, frame: Frame, width_px: int, height_px: int) -> NDArray[np.uint8]:
        """Return the exact class ids of a delivered frame's view, (height_px, width_px)."""

    def depth(self, frame: Frame, width_px: int, height_px: int) -> NDArray[np.float32]:
        """Return the exact depth along the optical axis, metres, (height_px, width_px)."""


@runtime_checkable
class Segmenter(Protocol):
    """Makes class maps from frames."""

    def segment(self, frame: Frame) -> ClassMap:
        """Return a class id for every pixel of the (resized) frame."""


@runtime_checkable
class DepthBeside(Protocol):
    """A segmenter whose network gives relative depth, too."""

    @property
    def relative_depth(self) -> DepthMap | None:
        """Relative depth of the frame that was segmented last; None before the first."""


@runtime_checkable
class DepthEstimator(Protocol):
    """Makes depth maps from frames."""

    def estimate(self, frame: Frame) -> DepthMap:
        """Return the depth of every pixel of the (resized) frame."""


@runtime_checkable
class Sight(Segmenter, DepthEstimator, Protocol):
    """Perception of a simulated drone without images: replaces networks, flow and tag detector.

    Class maps and depths have the errors of a network.
    """

    def mark(self, frame: Frame) -> MarkSighting | None:
        """Return the landing mark in a delivered frame, with the errors of a finder in images."""

    def motion(self, first: Frame, second: Frame) -> Pose2D | None:
        """Return the second lens's pose in the first's level frame; None without enough ground."""


@runtime_checkable
class Imageless(Protocol):
    """A simulated drone whose frames show nothing: it perceives by its `sight`."""

    @property
    def sight(self) -> Sight | None:
        """The perception; None before connecting, and if frames are looked at."""


class StillState(enum.Enum):
    """State of a photograph that was asked for."""

    TAKING = "taking"
    SAVED = "saved"
    FAILED = "failed"


@dataclass(frozen=True, kw_only=True)
class Still:
    """A photograph that was asked for."""

    state: StillState = StillState.TAKING
    media: str = ""  # identifier of the saved photograph on the drone; empty before
    reason: str = ""  # why it failed, such as "the memory card is full"; empty otherwise


@runtime_checkable
class StillCamera(Protocol):
    """Takes photographs onto the drone's memory card; only `fetch_still` waits."""

    def take_still(self) -> int:
        """Ask for a photograph of this moment; return its number."""

    def still(self, number: int) -> Still:
        """Return the present state of a photograph, by its number."""

    def fetch_still(self, media: str, limit_s: float) -> bytes:
        """Return a saved photograph as a JPEG file, within a limit of seconds; else DroneError."""


@runtime_checkable
class Photographing(Protocol):
    """A drone whose camera takes photographs besides the video."""

    @property
    def stills(self) -> StillCamera | None:
        """The camera; None before connecting, and for a drone without a camera."""


@dataclass(frozen=True, kw_only=True)
class PolicyView:
    """The input of a leaf policy."""

    class_map: ClassMap  # of the newest frame
    camera: CameraModel  # at the class map's size
    gimbal_pitch_rad: float  # when the frame was captured; 0 level, negative down
    height_above_ground_m: float  # when the frame was captured
    # The site map. Its `near` has the obstacles near the drone, including those out of view. None
    # without `MapSite`.
    site_map: SiteMap | None = None
    corridor: Corridor | None = None  # the free distance ahead; None without depth in the tree
    # The pixels of the last seconds; None without `RememberViews`
    recent: RecentViews | None = None
    turning: int = 0  # direction of the present turn: +1 clockwise, -1 counter-clockwise, 0 none
    # Full turns in a row without a free path; the policy may accept less clearance
    full_turns: int = 0
    tie_break: float = 0.5  # a random number, uniform in [0, 1), so that policies stay pure
    clearances: Clearances = field(default_factory=Clearances)  # distances that routes keep


@dataclass(frozen=True, kw_only=True)
class Advice:
    """A policy's answer to one view, not flown: a label for imitation learning."""

    frame_index: int
    captured_s: float  # of the frame
    x_m: float  # position of the body at that time, in the frame of `RecentViews`
    y_m: float
    yaw_rad: float
    height_above_ground_m: float
    gimbal_pitch_rad: float
    turning: int  # as in `PolicyView`
    full_turns: int
    answer: Answer  # with that `turning`
    fresh: Answer  # to the same view with `turning` 0


@runtime_checkable
class LeafPolicy(Protocol):
    """Decides where to fly next. Pure: the same view gives the same answer."""

    def decide(self, view: PolicyView) -> Answer:
        """Return the answer to a view."""
