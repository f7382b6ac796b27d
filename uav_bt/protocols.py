"""The interfaces of the system: drone, referee, clock, network and policy."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Never, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from uav_bt.answers import Answer
from uav_bt.types import (
    Airframe,
    CameraModel,
    ClassMap,
    Clearances,
    Command,
    Corridor,
    DepthMap,
    Frame,
    Observation,
    RecentViews,
    Truth,
)
from uav_bt.types.ground import Ground
from uav_bt.types.site_map import SiteMap


@runtime_checkable
class Clock(Protocol):
    """The mission's time, seconds."""

    def now(self) -> float:
        """Return the present time."""
        ...

    def sleep_until(self, time_s: float) -> None:
        """Return when that time has come (in the twin: step the physics up to it)."""
        ...


@runtime_checkable
class Scene(Protocol):
    """The place that a simulated drone flies in."""

    @property
    def name(self) -> str:
        """What reports call it."""
        ...


@runtime_checkable
class Drone(Protocol):
    """Anything that flies. Nothing external happens before `connect`."""

    @property
    def clock(self) -> Clock:
        """The clock that the whole mission uses."""
        ...

    @property
    def camera(self) -> CameraModel:
        """The camera's intrinsics at the size of the frames it sends."""
        ...

    @property
    def referee(self) -> Referee | None:
        """The truth, where there is one; None on a real drone."""
        ...

    @property
    def scene(self) -> Scene | None:
        """Where a simulated drone flies; None on a real drone."""
        ...

    @property
    def live(self) -> bool:
        """Whether it is checked (battery, link, telemetry, video) before it takes off."""
        ...

    @property
    def tick_s(self) -> float | None:
        """The length of a tick, seconds, where the drone's own pace counts; else None."""
        ...

    @property
    def airframe(self) -> Airframe:
        """Size and reaction of the body; `Airframe()` where nothing better is known."""
        ...

    def connect(self) -> None:
        """Get ready to fly.

        Raises:
            DroneError: the drone cannot be reached.
        """
        ...

    def observe(self) -> Observation:
        """Return the newest frame and state; never blocks."""
        ...

    def send(self, command: Command) -> Command:
        """Send a command; return what was really sent (after the drone's own limits)."""
        ...

    def disconnect(self) -> None:
        """Let go; safe to call twice."""
        ...


class DroneConfig(Protocol):
    """What the entry-point group `uav_bt.drones` registers: a dataclass of one kind of drone.

    Its fields are what can be set about that drone, keyword-only and with defaults. Those that bear
    a name of `uav_bt.app.assembly.drone_settings` (`scene`, `seed`, `address`, ...) are filled in
    from the options of a flight.
    """

    def create(self) -> Drone:
        """Return an unconnected drone.

        Raises:
            InputError: the drone cannot be made with these settings.
        """
        ...


@runtime_checkable
class Referee(Protocol):
    """The truth of a simulation, for reports and evaluations only."""

    def truth(self) -> Truth:
        """Return the truth of this moment."""
        ...

    def ground(self) -> Ground | None:
        """Return the place's ground; None where it is not known, and coverage is not measured."""
        ...

    def class_ids(self, frame: Frame, width_px: int, height_px: int) -> NDArray[np.uint8]:
        """Return the exact class ids of a delivered frame's view, (height_px, width_px)."""
        ...

    def depth(self, frame: Frame, width_px: int, height_px: int) -> NDArray[np.float32]:
        """Return the exact depth along the optical axis, metres, (height_px, width_px)."""
        ...


@runtime_checkable
class Segmenter(Protocol):
    """Frame in, class map out."""

    def segment(self, frame: Frame) -> ClassMap:
        """Return a class id for every pixel of the (resized) frame."""
        ...


@runtime_checkable
class DepthEstimator(Protocol):
    """Frame in, depth map out."""

    def estimate(self, frame: Frame) -> DepthMap:
        """Return the depth of every pixel of the (resized) frame."""
        ...


@dataclass(frozen=True, kw_only=True)
class PolicyView:
    """The input of a leaf policy.

    Attributes:
        class_map: of the newest frame.
        camera: at the class map's size.
        gimbal_pitch_rad: when the frame was captured; 0 level, negative down.
        height_above_carpet_m: when the frame was captured.
        site_map: the map of the place, `near` among it: obstacles near the drone, also those out
            of view; None without `MapSite`.
        corridor: how far the path is free; None without depth in the tree.
        recent: the pixels of the last seconds; None without `RememberViews`.
        turning: a turn under way: +1 clockwise, -1 counter-clockwise, 0 none.
        full_turns: full turns in a row that found no free path: less clearance may do.
        tie_break: a uniform draw from [0, 1), so that policies stay pure.
        clearances: distances that routes keep in the place.
    """

    class_map: ClassMap
    camera: CameraModel
    gimbal_pitch_rad: float
    height_above_carpet_m: float
    site_map: SiteMap | None = None
    corridor: Corridor | None = None
    recent: RecentViews | None = None
    turning: int = 0
    full_turns: int = 0
    tie_break: float = 0.5
    clearances: Clearances = field(default_factory=Clearances)


@dataclass(frozen=True, kw_only=True)
class Advice:
    """A policy's answer to one view, not flown: a label for imitation learning."""

    frame_index: int
    captured_s: float  # of the frame
    x_m: float  # where the body was then: `RecentViews`' frame
    y_m: float
    yaw_rad: float
    height_above_carpet_m: float
    gimbal_pitch_rad: float
    turning: int  # the turn under way when the policy was asked, as in `PolicyView`
    full_turns: int
    answer: Answer  # with that turn under way
    fresh: Answer  # to the same view with none


@runtime_checkable
class LeafPolicy(Protocol):
    """Where to go next. Pure: the same view gives the same answer."""

    def decide(self, view: PolicyView) -> Answer:
        """Return the next movement, or that there is none."""
        ...


if not TYPE_CHECKING:

    def __getattr__(name: str) -> Never:
        if name == "Decision":
            # An AttributeError's text would be lost in `from uav_bt.protocols import Decision`.
            raise ImportError(
                "uav_bt.protocols has no Decision any more: a policy returns Advance, FollowLeg, "
                "Rotate, Blocked or Done of uav_bt.answers"
            )
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
