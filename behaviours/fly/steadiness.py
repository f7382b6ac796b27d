"""Whether the drone is steady enough for a photograph."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from uav_bt.types import DroneState, wrap_angle
from uav_bt.types.dead_reckoning import MotionEstimate


@dataclass(frozen=True, kw_only=True)
class SteadinessConfig:
    """When the drone counts as steady.

    Chosen by the telemetry of a hovering drone: with the twin's profile `harsh` the noise of one
    sample reaches 0.31 m/s and 18 degrees a second, over half a second 0.21 m/s and 5.
    """

    span_s: float = 0.5  # velocity and heading are averaged over this time
    speed_mps: float = 0.2
    turn_radps: float = math.radians(8)


@dataclass(frozen=True)
class _Sample:
    time_s: float
    velocity: tuple[float, float, float]
    heading_s: float
    yaw_rad: float


class Steadiness:
    """Follows telemetry until the drone keeps place and heading; the camera levels itself.

    Args:
        config: When the drone counts as steady.

    Attributes:
        since_s: Capture time of the telemetry since which the drone is steady. inf: it is not.
    """

    def __init__(self, config: SteadinessConfig | None = None) -> None:
        self._config = config or SteadinessConfig()
        self._samples: deque[_Sample] = deque()
        self.since_s = math.inf

    def update(self, state: DroneState, motion: MotionEstimate | None) -> None:
        """Add telemetry. The drone is not steady before the samples span the time of an average.

        Args:
            state: Newest telemetry.
            motion: Motion over the ground, which corrects the velocity. None: unknown.
        """
        samples = self._samples
        if samples and state.captured_s <= samples[-1].time_s:
            return
        velocity = (state if motion is None else motion.over_ground(state)).velocity
        speeds = (velocity.forward_mps, velocity.right_mps, velocity.down_mps)
        yaw_rad = state.attitude.yaw_rad
        samples.append(_Sample(state.captured_s, speeds, state.times.attitude_s, yaw_rad))
        # The oldest sample lies at least the span back, once there are such old ones.
        while len(samples) > 2 and samples[1].time_s <= state.captured_s - self._config.span_s:
            samples.popleft()
        if not self._is_steady():
            self.since_s = math.inf
        elif math.isinf(self.since_s):
            self.since_s = state.captured_s

    def _is_steady(self) -> bool:
        config, oldest, newest = self._config, self._samples[0], self._samples[-1]
        if newest.time_s - oldest.time_s < config.span_s - 1e-6:
            return False
        mean = np.mean([sample.velocity for sample in self._samples], axis=0)
        if float(np.linalg.norm(mean)) > config.speed_mps:
            return False
        passed_s = newest.heading_s - oldest.heading_s
        turned_rad = abs(wrap_angle(newest.yaw_rad - oldest.yaw_rad))
        return passed_s > 0.0 and turned_rad / passed_s <= config.turn_radps
