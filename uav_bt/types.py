"""The vocabulary: immutable values that travel from the drone to the board, the leaves and back.

Conventions (see ``ARCHITECTURE.md``): metres, radians, seconds of the mission clock. The body frame
is Parrot's: x forward, y right, z down, yaw clockwise positive seen from above. Images are RGB.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ShapeError, ValueRangeError

__all__ = [
    "HOVER",
    "Attitude",
    "BodyVelocity",
    "CameraModel",
    "ClassMap",
    "Command",
    "Corridor",
    "CutMotors",
    "DepthMap",
    "DroneState",
    "FlyingState",
    "Frame",
    "GimbalTo",
    "HeldTurn",
    "HelipadFix",
    "Hover",
    "Land",
    "MoveBy",
    "Movement",
    "MovementState",
    "MovementStatus",
    "Observation",
    "ObstaclePoints",
    "PastView",
    "Pose",
    "RecentViews",
    "Release",
    "TakeOff",
    "Truth",
    "Velocity",
    "wrap_angle",
]


def wrap_angle(angle_rad: float) -> float:
    """Return the angle folded into [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def _check_shape(name: str, array: NDArray[np.generic], ndim: int, last: int | None = None) -> None:
    if array.ndim != ndim or (last is not None and array.shape[-1] != last):
        dims = "x".join(["H", "W"][:ndim] + ([str(last)] if last else []))
        raise ShapeError(name, expected=dims, actual=array.shape)


# --- the camera -----------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class CameraModel:
    """A pinhole camera in OpenCV's frame (x right, y down, z forward)."""

    width_px: int  # the size this calibration was made at
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: tuple[float, ...] = ()  # OpenCV's k1, k2, p1, p2, k3, ...; empty means none
    forward_offset_m: float = 0.15  # camera ahead of the body's centre

    def __post_init__(self) -> None:
        if self.width_px <= 0 or self.height_px <= 0 or self.fx_px <= 0 or self.fy_px <= 0:
            raise ValueRangeError(
                "camera size and focal lengths must be positive, got "
                f"{self.width_px}x{self.height_px}, f = ({self.fx_px}, {self.fy_px})"
            )

    def resized(self, width_px: int, height_px: int) -> CameraModel:
        """Return the intrinsics of the same image resized (not cropped) to another size.

        A resize that changes the aspect (640x360 to the network's 224x112) gives unequal focal
        lengths, which is exact for a resized image. Pixel centres are at integer coordinates, as in
        OpenCV.
        """
        sx, sy = width_px / self.width_px, height_px / self.height_px
        return CameraModel(
            width_px=width_px,
            height_px=height_px,
            fx_px=self.fx_px * sx,
            fy_px=self.fy_px * sy,
            cx_px=(self.cx_px + 0.5) * sx - 0.5,
            cy_px=(self.cy_px + 0.5) * sy - 0.5,
            distortion=self.distortion,
            forward_offset_m=self.forward_offset_m,
        )


# --- what a drone tells ---------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Attitude:
    """Body attitude, radians: roll right-down positive, pitch nose-up positive, yaw clockwise."""

    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0


@dataclass(frozen=True, kw_only=True)
class BodyVelocity:
    """Velocity in the heading-aligned body frame, metres a second."""

    forward_mps: float = 0.0
    right_mps: float = 0.0
    down_mps: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Frame:
    """One camera image with the telemetry of the moment it was captured."""

    image: NDArray[np.uint8]  # (H, W, 3), RGB
    index: int  # counts captured frames, so that a repeated frame is recognised
    captured_s: float
    gimbal_pitch_rad: float  # 0 level, negative down; stabilised, so relative to the horizon
    attitude: Attitude = field(default_factory=Attitude)
    altitude_m: float = 0.0  # above the take-off point
    height_m: float = 0.0  # above the surface below
    height_above_carpet_m: float = 0.0

    def __post_init__(self) -> None:
        _check_shape("frame image", self.image, 3, 3)


class FlyingState(enum.Enum):
    """Where the drone is in a flight (the ANAFI's flying states, less the ones we never see)."""

    LANDED = "landed"
    TAKING_OFF = "taking_off"
    HOVERING = "hovering"
    FLYING = "flying"
    LANDING = "landing"
    EMERGENCY = "emergency"


class MovementState(enum.Enum):
    """How a `MoveBy` is doing."""

    RUNNING = "running"
    DONE = "done"
    INTERRUPTED = "interrupted"
    REJECTED = "rejected"


@dataclass(frozen=True, kw_only=True)
class MovementStatus:
    """The drone's word on the latest `MoveBy` it was told."""

    id: int
    state: MovementState


@dataclass(frozen=True, kw_only=True)
class DroneState:
    """Telemetry that does not belong to a frame."""

    captured_s: float
    flying: FlyingState
    attitude: Attitude = field(default_factory=Attitude)
    velocity: BodyVelocity = field(default_factory=BodyVelocity)
    altitude_m: float = 0.0  # above the take-off point
    height_m: float = 0.0  # above the surface below
    height_above_carpet_m: float = 0.0
    gimbal_pitch_rad: float = 0.0
    battery: float = 1.0  # 0 to 1
    link: float = 1.0  # quality of the radio link as the drone rates it, 0 to 1
    movement: MovementStatus | None = None
    pilot_has_control: bool = False  # a person took over


@dataclass(frozen=True, kw_only=True)
class Observation:
    """The newest frame (None before the first) and the newest state."""

    frame: Frame | None
    state: DroneState


# --- what a drone is told -------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class TakeOff:
    """Start the motors and climb to the drone's own take-off height."""


@dataclass(frozen=True, kw_only=True)
class Land:
    """Descend where it hovers and stop the motors."""


@dataclass(frozen=True, kw_only=True)
class Hover:
    """Hold the position."""


@dataclass(frozen=True, kw_only=True)
class CutMotors:
    """Stop the motors at once; the drone falls. The last resort of an operator."""


@dataclass(frozen=True, kw_only=True)
class Release:
    """Send nothing: a person flies."""


@dataclass(frozen=True, kw_only=True)
class MoveBy:
    """A relative movement in the body frame of the moment it starts; ends with an event."""

    id: int
    forward_m: float = 0.0
    right_m: float = 0.0
    down_m: float = 0.0
    yaw_rad: float = 0.0

    def __post_init__(self) -> None:
        values = (self.forward_m, self.right_m, self.down_m, self.yaw_rad)
        if not all(math.isfinite(value) for value in values):
            raise ValueRangeError(f"a movement must be finite, got {self}")


@dataclass(frozen=True, kw_only=True)
class Velocity:
    """Velocity piloting in the heading-aligned body frame; holds until the next command."""

    forward_mps: float = 0.0
    right_mps: float = 0.0
    down_mps: float = 0.0
    yaw_rate_radps: float = 0.0

    def __post_init__(self) -> None:
        values = (self.forward_mps, self.right_mps, self.down_mps, self.yaw_rate_radps)
        if not all(math.isfinite(value) for value in values):
            raise ValueRangeError(f"a velocity must be finite, got {self}")


Movement = TakeOff | Land | Hover | CutMotors | Release | MoveBy | Velocity


@dataclass(frozen=True, kw_only=True)
class GimbalTo:
    """Point the camera: 0 level, -pi/2 straight down."""

    pitch_rad: float

    def __post_init__(self) -> None:
        if not -math.pi / 2 - 1e-9 <= self.pitch_rad <= math.pi / 2 + 1e-9:
            raise ValueRangeError(
                f"gimbal pitch must lie within -pi/2 and pi/2 rad, got {self.pitch_rad}"
            )


@dataclass(frozen=True, kw_only=True)
class Command:
    """What one tick sends: a movement, and on its own channel the gimbal (None: leave it)."""

    movement: Movement
    gimbal: GimbalTo | None = None


HOVER = Command(movement=Hover())


# --- what perception tells ------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class ClassMap:
    """A class id for every pixel of a (resized) frame; the ids are `perception.classes`."""

    ids: NDArray[np.uint8]  # (H, W)
    captured_s: float  # of the frame it was made from

    def __post_init__(self) -> None:
        _check_shape("class map", self.ids, 2)


@dataclass(frozen=True, kw_only=True)
class DepthMap:
    """Depth along the optical axis for every pixel of a (resized) frame."""

    depth: NDArray[np.float32]  # (H, W); metres when metric, arbitrary unit when relative
    metric: bool
    captured_s: float
    confidence: float = 1.0  # 0 to 1
    # (H, W) metres: an upper bound, also where the depth itself is unknown (NaN); inf without one.
    at_most: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        _check_shape("depth map", self.depth, 2)
        if self.at_most is not None and self.at_most.shape != self.depth.shape:
            height, width = self.depth.shape
            raise ShapeError(
                "upper bound of a depth map",
                expected=f"{height}x{width}, as the depth",
                actual=self.at_most.shape,
            )


@dataclass(frozen=True, kw_only=True)
class Corridor:
    """What the five-plane safety corridor found in a depth map."""

    captured_s: float
    free_distance_m: float  # straight ahead, from the body's centre
    nearest_m: float  # nearest intrusion from the body's centre; inf when there is none
    nearest_side: Literal["left", "right", "front", "up", "down"] | None
    time_to_impact_s: float  # at the present speed; inf when nothing is ahead
    nearest_left_m: float = math.inf  # likewise, of the intrusions left of the way
    nearest_right_m: float = math.inf
    unknown_px: int = 0  # pixels of things that may be in the corridor, at a depth nobody knows


@dataclass(frozen=True, kw_only=True)
class HeldTurn:
    """A turn on the spot that is held in one direction until the drone advances again."""

    direction: int = 0  # +1 clockwise, -1 counter-clockwise, 0 none
    turned_rad: float = 0.0  # since the last advance, both ways added up

    @property
    def full_turns(self) -> int:
        """How many full turns found no free way."""
        return int(self.turned_rad / (2.0 * math.pi))


@dataclass(frozen=True, kw_only=True)
class HelipadFix:
    """Where the helipad lies, from the body's centre in the heading-aligned horizontal plane."""

    captured_s: float  # of the frame of the last detection that went in
    forward_m: float
    right_m: float
    detected: bool  # True: seen in this frame; False: carried by the tracker
    confidence: float = 1.0  # 0 to 1, of the last detection
    std_m: float = 0.0  # one standard deviation of the position

    @property
    def range_m(self) -> float:
        """Horizontal distance from the body's centre to the pad's centre."""
        return math.hypot(self.forward_m, self.right_m)

    @property
    def bearing_rad(self) -> float:
        """Direction of the pad, clockwise positive from the heading."""
        return math.atan2(self.right_m, self.forward_m)


# Passing a point that lies abeam brings it nearer by this little; that is no approach.
_PASSING_M = 0.02


@dataclass(frozen=True, kw_only=True)
class ObstaclePoints:
    """Where obstacles stand on the carpet, as seen lately, from the body's centre now."""

    points_m: NDArray[np.float64]  # (N, 2): forward, right, in the heading-aligned level frame
    captured_s: float  # of the newest frame that went in
    # (K, 2): likewise, where obstacles of unknown range are assumed for the time being.
    assumed_m: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    # (E, 2): likewise, where the carpet ends.
    edges_m: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    # Obstacles nearer than the nearest visible carpet, whose base was never seen: their bearings
    # from the heading, clockwise positive, one for each degree that shows them. (M,)
    unplaced_rad: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        for points in (self.points_m, self.assumed_m, self.edges_m):
            if points.ndim != 2 or points.shape[1] != 2:
                raise ShapeError("obstacle points", expected="Nx2", actual=points.shape)

    @property
    def nearest_m(self) -> float:
        """Distance from the body's centre to the nearest point, inf without any."""
        if not len(self.points_m):
            return math.inf
        return float(np.hypot(self.points_m[:, 0], self.points_m[:, 1]).min())

    def allows(
        self, forward_m: float, right_m: float = 0.0, *, margin_m: float, assumed: bool = True
    ) -> bool:
        """Return whether a straight way keeps a margin from every point.

        What is already nearer than the margin may be passed and left, but not approached.

        Args:
            forward_m: the end of the way, from the body's centre.
            right_m: likewise.
            margin_m: smallest distance of a point to the way.
            assumed: whether the assumed points count, too.
        """
        length_m = math.hypot(forward_m, right_m)
        points = np.vstack([self.points_m, self.assumed_m]) if assumed else self.points_m
        if not len(points) or length_m == 0.0:
            return True
        along = np.clip(points @ (forward_m / length_m, right_m / length_m), 0.0, length_m)
        way = along[:, None] * (forward_m / length_m, right_m / length_m)
        then_m = np.linalg.norm(points - way, axis=1)
        now_m = np.linalg.norm(points, axis=1)
        return bool(np.all((then_m >= margin_m) | (then_m >= now_m - _PASSING_M)))

    def unplaced_within(self, half_angle_rad: float) -> int:
        """Return how many bearings of ahead show an obstacle of unknown range."""
        return int(np.count_nonzero(np.abs(self.unplaced_rad) < half_angle_rad))


@dataclass(frozen=True, kw_only=True, eq=False)
class PastView:
    """A frame, and where the body was when it was captured."""

    frame: Frame
    # In a dead-reckoned frame of the mission's own: x along yaw 0, y to its right.
    x_m: float
    y_m: float
    yaw_rad: float  # clockwise positive, as the drone reports it


@dataclass(frozen=True, kw_only=True, eq=False)
class RecentViews:
    """What was seen in the last seconds; two of them tell what movement lies between."""

    views: tuple[PastView, ...]  # the oldest first

    def __post_init__(self) -> None:
        if not self.views:
            raise ValueRangeError("recent views must hold at least the present one, got none")

    @property
    def newest(self) -> PastView:
        """The present view."""
        return self.views[-1]

    def ago(self, seconds: float) -> PastView:
        """Return the view nearest to so many seconds before the newest; the newest counts too."""
        wanted_s = self.newest.frame.captured_s - seconds
        return min(self.views, key=lambda view: abs(view.frame.captured_s - wanted_s))


# --- the truth, for referees only -----------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Pose:
    """A pose in the world: z up, right-handed, origin in the carpet's middle."""

    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float  # counter-clockwise from +x, as the world has it


@dataclass(frozen=True, kw_only=True)
class Truth:
    """What only a simulator knows; used by reports and evaluations, never by the mission."""

    time_s: float
    pose: Pose
    contacts: tuple[str, ...]  # geoms the body touches now, the ground and the pad included
    clearance_m: float  # from the hull to the nearest box, inf without boxes
    inside_carpet: bool  # the body's centre
    on_helipad: bool  # the body's centre is above the pad
    landing_error_m: float  # horizontal, body centre to pad centre
    motors_on: bool
