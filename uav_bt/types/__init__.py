"""The vocabulary: immutable values that travel from the drone to the board, the leaves and back.

Conventions (see ``ARCHITECTURE.md``): metres, radians, seconds of the mission clock. The body frame
is Parrot's: x forward, y right, z down, yaw clockwise positive seen from above. Images are RGB.
"""

from uav_bt.types.airframe import Airframe
from uav_bt.types.bounds import clamp, limit_length
from uav_bt.types.camera import CameraModel, ClassMap, Corridor, DepthMap, Frame
from uav_bt.types.clearances import NARROWER_M, Clearances
from uav_bt.types.commands import (
    HOVER,
    Command,
    CutMotors,
    GimbalTo,
    Hover,
    Land,
    MissionPhase,
    MoveBy,
    Movement,
    Phase,
    Release,
    TakeOff,
    Velocity,
)
from uav_bt.types.drone_state import (
    Attitude,
    BodyVelocity,
    DroneFault,
    DroneState,
    FlyingState,
    MeasurementTimes,
    MovementState,
    MovementStatus,
)
from uav_bt.types.landing_mark import LandingMark
from uav_bt.types.observation import MoverState, Observation, PastView, RecentViews, Truth
from uav_bt.types.pose import Pose, Pose2D, rotate, rotate_points, rotation, wrap_angle, wrap_angles
from uav_bt.types.site_map import MapMark, MapMover, MapObject, SiteMap
from uav_bt.types.surroundings import (
    MIN_VIEW_HEIGHT_M,
    HeldTurn,
    MarkFix,
    NearObstacles,
)

__all__ = [
    "HOVER",
    "MIN_VIEW_HEIGHT_M",
    "NARROWER_M",
    "Airframe",
    "Attitude",
    "BodyVelocity",
    "CameraModel",
    "ClassMap",
    "Clearances",
    "Command",
    "Corridor",
    "CutMotors",
    "DepthMap",
    "DroneFault",
    "DroneState",
    "FlyingState",
    "Frame",
    "GimbalTo",
    "HeldTurn",
    "Hover",
    "Land",
    "LandingMark",
    "MapMark",
    "MapMover",
    "MapObject",
    "MarkFix",
    "MeasurementTimes",
    "MissionPhase",
    "MoveBy",
    "Movement",
    "MovementState",
    "MovementStatus",
    "MoverState",
    "NearObstacles",
    "Observation",
    "PastView",
    "Phase",
    "Pose",
    "Pose2D",
    "RecentViews",
    "Release",
    "SiteMap",
    "TakeOff",
    "Truth",
    "Velocity",
    "clamp",
    "limit_length",
    "rotate",
    "rotate_points",
    "rotation",
    "wrap_angle",
    "wrap_angles",
]
