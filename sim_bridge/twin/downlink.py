"""Radio link of the twin's telemetry: each quantity has a rate and a delay."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

import numpy as np

from sim_bridge.twin.noise import child_seed
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.sensors import Telemetry
from uav_bt.types import Attitude, BodyVelocity, FlyingState, MeasurementTimes, MovementStatus

_TIME_SLACK_S: Final = 1e-6  # rounding error of a sum of control steps, s

Value = TypeVar("Value")


class _Stream(Generic[Value]):
    """Transmission of one quantity.

    Args:
        period_s: time between two measurements that are sent, s; 0 sends every measurement.
        latency_s: time from a measurement to its arrival, s.
        phase: share of a period before the second measurement is sent. The first arrives at once.
    """

    def __init__(self, period_s: float, latency_s: float, phase: float) -> None:
        self._period_s, self._latency_s = period_s, latency_s
        self._due_s = phase * period_s
        self._sent: deque[tuple[float, Value]] = deque()
        self._heard: tuple[float, Value] | None = None

    def take(self, value: Value, now_s: float) -> None:
        """Send a measurement if one is due, and receive those whose delay has passed."""
        if now_s >= self._due_s - _TIME_SLACK_S:
            self._due_s += self._period_s
            self._sent.append((now_s, value))
        if self._heard is None:
            self._heard = now_s, value
        while self._sent and self._sent[0][0] + self._latency_s <= now_s + _TIME_SLACK_S:
            self._heard = self._sent.popleft()

    @property
    def heard(self) -> tuple[float, Value]:
        """The newest measurement that has arrived, and its time."""
        if self._heard is None:
            raise RuntimeError("telemetry is read before the first control step measured it")
        return self._heard


@dataclass(frozen=True, kw_only=True, slots=True)
class Events:
    """States that are sent when they change."""

    flying: FlyingState
    movement: MovementStatus | None


@dataclass(frozen=True, kw_only=True, slots=True)
class Heard:
    """The newest value of each quantity that has arrived, with its measurement time."""

    attitude: Attitude
    velocity: BodyVelocity
    altitude_m: float
    height_m: float
    height_above_ground_m: float
    gimbal_pitch_rad: float
    events: Events
    times: MeasurementTimes


class Downlink:
    """Delivers telemetry from the drone to the mission.

    All quantities are known at the first step, because a drone reports its whole state on
    connecting.

    Args:
        profile: rates and delays.
        seed: seed of the flight; sets the phase at which measurements are sent.
    """

    def __init__(self, profile: Profile, seed: int) -> None:
        phase = float(np.random.default_rng(child_seed(seed, 11)).random())
        self._attitude = _Stream[Attitude](
            profile.attitude_period_s, profile.attitude_latency_s, phase
        )
        self._velocity = _Stream[BodyVelocity](
            profile.velocity_period_s, profile.velocity_latency_s, phase
        )
        self._heights = _Stream[Telemetry](
            profile.altitude_period_s, profile.altitude_latency_s, phase
        )
        self._gimbal = _Stream[float](profile.gimbal_period_s, profile.gimbal_latency_s, phase)
        self._events = _Stream[Events](0.0, profile.event_latency_s, phase)

    def take(
        self, telemetry: Telemetry, gimbal_pitch_rad: float, events: Events, now_s: float
    ) -> None:
        """Send the measurements of one control step, and receive those that are due.

        Args:
            telemetry: measurements of the motion.
            gimbal_pitch_rad: pitch of the camera; 0 level, negative down.
            events: flying state and movement status.
            now_s: time of the step; must not decrease.
        """
        self._attitude.take(telemetry.attitude, now_s)
        self._velocity.take(telemetry.velocity, now_s)
        self._heights.take(telemetry, now_s)
        self._gimbal.take(gimbal_pitch_rad, now_s)
        self._events.take(events, now_s)

    @property
    def heard(self) -> Heard:
        """The telemetry that has arrived."""
        attitude_s, attitude = self._attitude.heard
        velocity_s, velocity = self._velocity.heard
        heights_s, heights = self._heights.heard
        gimbal_s, gimbal_pitch_rad = self._gimbal.heard
        return Heard(
            attitude=attitude,
            velocity=velocity,
            altitude_m=heights.altitude_m,
            height_m=heights.height_m,
            height_above_ground_m=heights.height_above_ground_m,
            gimbal_pitch_rad=gimbal_pitch_rad,
            events=self._events.heard[1],
            times=MeasurementTimes(
                attitude_s=attitude_s,
                velocity_s=velocity_s,
                altitude_s=heights_s,
                height_s=heights_s,
                gimbal_s=gimbal_s,
            ),
        )
