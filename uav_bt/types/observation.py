"""Observations of a drone, now and in the last seconds, and the truth of a simulated one."""

from __future__ import annotations

from dataclasses import dataclass

from uav_bt.types.camera import Frame
from uav_bt.types.dead_reckoning import OdometryPose
from uav_bt.types.drone_state import DroneState
from uav_bt.types.pose import Pose


@dataclass(frozen=True, kw_only=True)
class Observation:
    """The newest frame (None before the first) and the newest state."""

    frame: Frame | None
    state: DroneState


@dataclass(frozen=True, kw_only=True, eq=False)
class PastView:
    """A frame, and the pose of the body at its capture."""

    frame: Frame
    pose: OdometryPose  # at the frame's capture


@dataclass(frozen=True, kw_only=True, eq=False)
class RecentViews:
    """The frames of the last seconds; two of them show the movement between them."""

    views: tuple[PastView, ...]  # the oldest first; at least one

    @property
    def newest(self) -> PastView:
        """The present view."""
        return self.views[-1]

    def ago(self, seconds: float) -> PastView:
        """Return the view nearest to a time before the newest, seconds; it may be the newest."""
        wanted_s = self.newest.frame.captured_s - seconds
        return min(self.views, key=lambda view: abs(view.frame.captured_s - wanted_s))


@dataclass(frozen=True, kw_only=True)
class MoverState:
    """Pose and velocity of a mover; world axes."""

    name: str
    pose: Pose  # of its middle
    vx_mps: float
    vy_mps: float


@dataclass(frozen=True, kw_only=True)
class Truth:
    """The truth of a simulator, for reports and evaluations, never for the mission."""

    time_s: float
    pose: Pose
    contacts: tuple[str, ...]  # geoms that the body touches now, including ground and pad
    clearance_m: float  # from the hull to the nearest box or mover, inf without any
    inside_ground: bool  # the body's centre is above the ground, not beyond its edge
    on_mark: bool  # the body's centre is above the pad
    landing_error_m: float | None  # horizontal, body centre to pad centre; None without a pad
    motors_on: bool
    gimbal_pitch_rad: float | None = None  # of the camera; None if unknown
    movers: tuple[MoverState, ...] = ()  # in the scene's order
