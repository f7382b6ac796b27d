"""Sensors of the twin: the autopilot's estimate of its motion, and the telemetry."""

from __future__ import annotations

from dataclasses import dataclass

from sim_bridge.twin.body import CONTROL_STEP_S, Motion
from sim_bridge.twin.noise import NormalStream, OrnsteinUhlenbeck, child_seed
from sim_bridge.twin.profile import Profile
from uav_bt.types import Attitude, BodyVelocity, Pose, rotate, wrap_angle


@dataclass(frozen=True, kw_only=True, slots=True)
class Estimate(Pose):
    """Estimated motion, with slow errors; world axes, yaw counter-clockwise."""

    vx_mps: float
    vy_mps: float
    vz_mps: float
    yaw_rate_radps: float


@dataclass(frozen=True, kw_only=True, slots=True)
class Telemetry:
    """Measurements at one time, in Parrot's conventions."""

    attitude: Attitude
    velocity: BodyVelocity
    altitude_m: float
    height_m: float
    height_above_ground_m: float


class Sensors:
    """Adds the errors of an ANAFI's sensors to the true motion.

    Args:
        profile: strength of the errors.
        seed: seed of the flight.
        start_z_m: height of the body's centre above the ground before take-off.
    """

    def __init__(self, profile: Profile, seed: int, *, start_z_m: float) -> None:
        self._profile = profile
        self._start_z_m = start_z_m
        self._white = NormalStream(child_seed(seed, 1))
        slow = NormalStream(child_seed(seed, 2))

        def wander(std: float, time_s: float) -> OrnsteinUhlenbeck:
            return OrnsteinUhlenbeck(std=std, time_s=time_s, step_s=CONTROL_STEP_S, stream=slow)

        self._flow_x = wander(profile.drift_std_mps, profile.drift_time_s)
        self._flow_y = wander(profile.drift_std_mps, profile.drift_time_s)
        self._yaw = wander(profile.yaw_drift_std_rad, profile.yaw_drift_time_s)
        errors = NormalStream(child_seed(seed, 12))
        self._climb = OrnsteinUhlenbeck(
            std=profile.climb_error_std_mps,
            time_s=profile.climb_error_time_s,
            step_s=CONTROL_STEP_S,
            stream=errors,
        )
        self._yaw_rate = errors.draw
        self._altitude = wander(profile.altimeter_bias_std_m, profile.altimeter_bias_time_s)
        # The drone zeroes its pressure sensor at take-off.
        self._altitude.value = 0.0
        self._lost_x_m = 0.0
        self._lost_y_m = 0.0
        self.drift_mps = (0.0, 0.0)  # steady velocity error of the optical flow, world x and y

    def estimate(self, motion: Motion, *, airborne: bool) -> Estimate:
        """Advance the errors by one control step and return the autopilot's estimate.

        Args:
            motion: the true motion.
            airborne: whether the drone is in the air; on the ground the estimate does not drift.
        """
        flow_x = flow_y = 0.0
        if airborne:
            flow_x = self._flow_x.step() - self.drift_mps[0]
            flow_y = self._flow_y.step() - self.drift_mps[1]
            self._lost_x_m += flow_x * CONTROL_STEP_S
            self._lost_y_m += flow_y * CONTROL_STEP_S
            self._altitude.step()
        return Estimate(
            x_m=motion.x_m + self._lost_x_m,
            y_m=motion.y_m + self._lost_y_m,
            z_m=motion.z_m + self._altitude.value,
            vx_mps=motion.vx_mps + flow_x,
            vy_mps=motion.vy_mps + flow_y,
            vz_mps=motion.vz_mps + self._climb.step(),
            yaw_rad=motion.yaw_rad + self._yaw.step(),
            yaw_rate_radps=(
                motion.yaw_rate_radps + self._profile.yaw_rate_noise_std_radps * self._yaw_rate()
            ),
        )

    def telemetry(self, motion: Motion, estimate: Estimate, surface_m: float) -> Telemetry:
        """Return the measurements of this step, with noise.

        Args:
            motion: the true motion.
            estimate: the autopilot's estimate.
            surface_m: height of the surface below the body's centre.
        """
        profile, draw = self._profile, self._white.draw
        altitude = estimate.z_m - self._start_z_m + profile.altimeter_noise_std_m * draw()
        forward_mps, left_mps = rotate(estimate.vx_mps, estimate.vy_mps, -estimate.yaw_rad)
        shake = profile.velocity_noise_std_mps
        return Telemetry(
            attitude=Attitude(
                roll_rad=motion.roll_rad + profile.attitude_noise_std_rad * draw(),
                pitch_rad=motion.pitch_rad + profile.attitude_noise_std_rad * draw(),
                yaw_rad=wrap_angle(-estimate.yaw_rad + profile.yaw_noise_std_rad * draw()),
            ),
            velocity=BodyVelocity(
                forward_mps=forward_mps + shake * draw(),
                right_mps=-left_mps + shake * draw(),
                down_mps=-estimate.vz_mps + shake * draw(),
            ),
            altitude_m=altitude,
            height_m=max(0.0, motion.z_m - surface_m + profile.height_noise_std_m * draw()),
            height_above_ground_m=altitude + self._start_z_m,
        )
