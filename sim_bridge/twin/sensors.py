"""Sensors of the twin: the autopilot's estimate of its motion, and the telemetry by radio."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np

from sim_bridge.twin.body import CONTROL_STEP_S, TIME_SLACK_S, Motion
from sim_bridge.twin.noise import NormalStream, OrnsteinUhlenbeck, child_seed
from sim_bridge.twin.profile import Profile, Report
from uav_bt.types import (
    Attitude,
    BodyVelocity,
    DroneState,
    FlyingState,
    MeasurementTimes,
    MovementStatus,
    rotate,
    wrap_angle,
)


class Sensors:
    """Adds the errors of an ANAFI's sensors to the true motion.

    Before take-off the body's centre is `start_z_m` above the ground.
    """

    def __init__(self, profile: Profile, seed: int, *, start_z_m: float) -> None:
        self._profile = profile
        self._start_z_m = start_z_m
        self._white = NormalStream(child_seed(seed, 1))
        slow, errors = NormalStream(child_seed(seed, 2)), NormalStream(child_seed(seed, 12))

        def wander(stream: NormalStream, std: float, time_s: float) -> OrnsteinUhlenbeck:
            return OrnsteinUhlenbeck(stream, std, time_s, CONTROL_STEP_S)

        self._flow_x = wander(slow, profile.drift_std_mps, profile.drift_time_s)
        self._flow_y = wander(slow, profile.drift_std_mps, profile.drift_time_s)
        self._yaw = wander(slow, profile.yaw_drift_std_rad, profile.yaw_drift_time_s)
        self._climb = wander(errors, profile.climb_error_std_mps, profile.climb_error_time_s)
        self._yaw_rate = errors.draw
        self._altitude = wander(slow, profile.altimeter_bias_std_m, profile.altimeter_bias_time_s)
        # The drone zeroes its pressure sensor at take-off.
        self._altitude.value = 0.0
        self._lost_x_m = 0.0
        self._lost_y_m = 0.0
        self.drift_mps = (0.0, 0.0)  # steady velocity error of the optical flow, world x and y

    def estimate(self, motion: Motion, *, airborne: bool) -> Motion:
        """Advance the errors by one control step and return the autopilot's estimate.

        The estimate drifts only in the air; roll and pitch have no error.
        """
        flow_x = flow_y = 0.0
        if airborne:
            flow_x = self._flow_x.step() - self.drift_mps[0]
            flow_y = self._flow_y.step() - self.drift_mps[1]
            self._lost_x_m += flow_x * CONTROL_STEP_S
            self._lost_y_m += flow_y * CONTROL_STEP_S
            self._altitude.step()
        climb_error = self._climb.step()
        yaw_rate_error = self._profile.yaw_rate_noise_std_radps * self._yaw_rate()
        return replace(
            motion,
            x_m=motion.x_m + self._lost_x_m,
            y_m=motion.y_m + self._lost_y_m,
            z_m=motion.z_m + self._altitude.value,
            vx_mps=motion.vx_mps + flow_x,
            vy_mps=motion.vy_mps + flow_y,
            vz_mps=motion.vz_mps + climb_error,
            yaw_rad=motion.yaw_rad + self._yaw.step(),
            yaw_rate_radps=motion.yaw_rate_radps + yaw_rate_error,
        )

    def telemetry(
        self,
        motion: Motion,
        estimate: Motion,
        *,
        surface_m: float,
        captured_s: float,
        flying: FlyingState,
        gimbal_pitch_rad: float,
        movement: MovementStatus | None = None,
    ) -> DroneState:
        """Return the noisy measurements of this step above a surface of a height."""
        profile, draw = self._profile, self._white.draw
        altitude_m = estimate.z_m - self._start_z_m + profile.altimeter_noise_std_m * draw()
        forward_mps, left_mps = rotate(estimate.vx_mps, estimate.vy_mps, -estimate.yaw_rad)
        shake, tilt = profile.velocity_noise_std_mps, profile.attitude_noise_std_rad
        return DroneState(
            captured_s=captured_s,
            flying=flying,
            attitude=Attitude(
                roll_rad=motion.roll_rad + tilt * draw(),
                pitch_rad=motion.pitch_rad + tilt * draw(),
                yaw_rad=wrap_angle(-estimate.yaw_rad + profile.yaw_noise_std_rad * draw()),
            ),
            velocity=BodyVelocity(
                forward_mps=forward_mps + shake * draw(),
                right_mps=-left_mps + shake * draw(),
                down_mps=-estimate.vz_mps + shake * draw(),
            ),
            altitude_m=altitude_m,
            height_m=max(0.0, motion.z_m - surface_m + profile.height_noise_std_m * draw()),
            height_above_ground_m=altitude_m + self._start_z_m,
            gimbal_pitch_rad=gimbal_pitch_rad,
            battery=max(0.0, 1.0 - captured_s / profile.battery_life_s),
            movement=movement,
        )


class _Stream:
    """Transmission of one quantity of the states.

    The first arrives at once, because a drone reports its whole state on connecting. The second is
    sent after a share of a period, `phase`.
    """

    def __init__(self, report: Report, phase: float) -> None:
        self._report = report
        self._due_s = phase * report.period_s
        self._sent: deque[DroneState] = deque()  # from the newest that has arrived on

    def take(self, state: DroneState) -> None:
        """Send a state if one is due, and receive those whose delay has passed."""
        sent, now_s = self._sent, state.captured_s + TIME_SLACK_S
        if not sent:
            sent.append(state)
        if now_s >= self._due_s:
            self._due_s += self._report.period_s
            sent.append(state)
        while len(sent) > 1 and sent[1].captured_s + self._report.latency_s <= now_s:
            sent.popleft()

    @property
    def heard(self) -> DroneState:
        """The newest state that has arrived."""
        return self._sent[0]


class Downlink:
    """Radio link from the drone to the mission: each quantity has a rate and a delay.

    The seed of the flight sets the phase at which states are sent.
    """

    def __init__(self, profile: Profile, seed: int) -> None:
        phase = float(np.random.default_rng(child_seed(seed, 11)).random())
        events = Report(0.0, profile.event_latency_s)
        reports = (profile.attitude, profile.velocity, profile.altitude, profile.gimbal, events)
        self._streams = [_Stream(report, phase) for report in reports]

    def take(self, state: DroneState) -> None:
        """Send the state of one control step, and receive what is due."""
        self._newest = state
        for stream in self._streams:
            stream.take(state)

    def state(self) -> DroneState:
        """Return what has arrived; the charge of the battery arrives at once."""
        attitude, velocity, altitude, gimbal, events = (each.heard for each in self._streams)
        times = MeasurementTimes(
            attitude_s=attitude.captured_s,
            velocity_s=velocity.captured_s,
            altitude_s=altitude.captured_s,
            height_s=altitude.captured_s,
            gimbal_s=gimbal.captured_s,
        )
        return replace(
            altitude,
            captured_s=times.oldest_s,
            flying=events.flying,
            attitude=attitude.attitude,
            velocity=velocity.velocity,
            gimbal_pitch_rad=gimbal.gimbal_pitch_rad,
            battery=self._newest.battery,
            movement=events.movement,
            measured=times,
        )
