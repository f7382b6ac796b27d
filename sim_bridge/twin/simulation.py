"""Simulation of the twin: physics, autopilot, sensors and gimbal, stepped together."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Final

from sim_bridge.anafi import CAMERA_FORWARD_M
from sim_bridge.twin.autopilot import Autopilot
from sim_bridge.twin.body import CONTROL_STEP_S, TIME_SLACK_S
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.flying_body import FlyingBody
from sim_bridge.twin.movers import Traffic
from sim_bridge.twin.noise import NormalStream, OrnsteinUhlenbeck, child_seed
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.reference import Pace
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.sensors import Downlink, Sensors
from uav_bt.errors import ValueRangeError
from uav_bt.types import Command, DroneState, MoverState, Pose
from uav_bt.types.pose import clamp

_REMEMBERED_FRAMES: Final = 900  # 30 s of video, for the referee
_CONTACT_MEMORY_S: Final = 0.1  # one tick: a reader once a tick gets all contacts


@dataclass(frozen=True, kw_only=True, slots=True)
class Capture:
    """Camera, movers and telemetry at one time, to render the frame later."""

    index: int
    time_s: float
    camera: CameraPose
    movers: tuple[MoverState, ...]
    exposure: float  # relative brightness
    telemetry: DroneState


class Simulation:
    """One flight from a pose of the body's centre. Time passes only in `run_until`.

    On one machine the same seed and commands give the same flight.
    """

    def __init__(
        self, scene: Scene, body: FlyingBody, profile: Profile, seed: int, start: Pose
    ) -> None:
        self._scene = scene
        self._profile = profile
        self._steps = 0
        self._queue: deque[tuple[float, Command, Pace | None]] = deque()
        self._traffic = Traffic(scene.movers, seed)
        self.movers = self._traffic.at(0.0)
        self.body = body
        self.body.place_movers(self.movers)
        self.body.place(start.x_m, start.y_m, start.z_m, start.yaw_rad)
        self._autopilot = Autopilot(profile)
        self._sensors = Sensors(profile, seed, start_z_m=start.z_m)
        self._downlink = Downlink(profile, seed)
        gusts, std = NormalStream(child_seed(seed, 3)), profile.wind_std_mps2
        self._wind = [
            OrnsteinUhlenbeck(gusts, std, profile.wind_time_s, CONTROL_STEP_S) for _ in range(3)
        ]
        self._breeze_mps2 = (0.0, 0.0)  # steady acceleration by the wind, world x and y
        self._exposure = OrnsteinUhlenbeck(
            NormalStream(child_seed(seed, 4)),
            profile.exposure_std,
            profile.exposure_time_s,
            1.0 / profile.video_rate_hz,
        )
        self.gimbal_pitch_rad = 0.0  # 0 level, negative down
        self._gimbal_target_rad = 0.0
        self._touched_s: dict[str, float] = {}
        self.frames: deque[Capture] = deque(maxlen=_REMEMBERED_FRAMES)  # oldest first
        self._frame_count = 0
        self._sense()

    @property
    def now_s(self) -> float:
        """Time since the start, s."""
        return self._steps * CONTROL_STEP_S

    @property
    def motors_on(self) -> bool:
        """Whether the rotors turn."""
        return self._autopilot.motors_on

    def disturb(self, *, wind_mps2: tuple[float, float], drift_mps: tuple[float, float]) -> None:
        """Apply a steady wind and a steady drift that the estimate misses, from now on."""
        self._breeze_mps2 = wind_mps2
        self._sensors.drift_mps = drift_mps

    def enqueue(self, command: Command, pace: Pace | None = None) -> None:
        """Send a command; it takes effect after the computing and transmission delays.

        A pace limits a `MoveBy`; by default the profile does.
        """
        delay_s = self._profile.compute_latency_s + self._profile.command_latency_s
        self._queue.append((self.now_s + delay_s, command, pace))

    def run_until(self, time_s: float) -> None:
        """Advance to a time in control steps; a past time has no effect."""
        while self.now_s < time_s - TIME_SLACK_S:
            self._step()

    def state(self) -> DroneState:
        """Return the telemetry that has arrived."""
        return self._downlink.state()

    def contacts(self) -> tuple[str, ...]:
        """Return the names of the geoms that the hull touched in the last 0.1 s with motors on."""
        since_s = self.now_s - _CONTACT_MEMORY_S - TIME_SLACK_S
        return tuple(sorted(name for name, at_s in self._touched_s.items() if at_s >= since_s))

    def capture_of(self, index: int) -> Capture:
        """Return the capture of a frame of the last 30 s by its number."""
        first = self.frames[0].index
        if 0 <= index - first < len(self.frames):
            return self.frames[index - first]
        raise ValueRangeError(
            f"frame {index} is not among the remembered frames {first} to "
            f"{self.frames[-1].index}; ask within 30 s of its capture"
        )

    def _step(self) -> None:
        while self._queue and self._queue[0][0] <= self.now_s + TIME_SLACK_S:
            _, command, pace = self._queue.popleft()
            self._autopilot.obey(command.movement, self._estimate, pace)
            if command.gimbal is not None:
                self._gimbal_target_rad = command.gimbal.pitch_rad
        demand = self._autopilot.update(
            self._estimate,
            height_m=self.motion.z_m - self._surface_m,
            touching=bool(self._touching),
        )
        if demand is None:
            self.body.drop()
        else:
            x_mps2, y_mps2, z_mps2 = (gust.step() for gust in self._wind)
            wind = (x_mps2 + self._breeze_mps2[0], y_mps2 + self._breeze_mps2[1], z_mps2)
            self.body.fly(self.motion, *demand, wind)
        error_rad = self._gimbal_target_rad - self.gimbal_pitch_rad
        rate_radps = clamp(error_rad / self._profile.gimbal_lag_s, self._profile.gimbal_rate_radps)
        self.gimbal_pitch_rad += rate_radps * CONTROL_STEP_S
        self._steps += 1
        self.movers = self._traffic.at(self.now_s)
        self.body.place_movers(self.movers)
        self.body.advance()
        self._sense()

    def _sense(self) -> None:
        """Measure after a step: motion, contacts, telemetry, and a frame if due."""
        self.motion = motion = self.body.motion()
        self._touching = self.body.contacts()
        if self.motors_on:
            self._touched_s.update(dict.fromkeys(self._touching, self.now_s))
        else:
            self._touched_s.clear()
        self._estimate = self._sensors.estimate(motion, airborne=self._autopilot.lifting)
        at_m = motion.x_m, motion.y_m, motion.z_m
        self._surface_m = self._scene.surface_m(*at_m, self.movers)
        telemetry = self._sensors.telemetry(
            motion,
            self._estimate,
            surface_m=self._surface_m,
            captured_s=self.now_s,
            flying=self._autopilot.flying_state,
            gimbal_pitch_rad=self.gimbal_pitch_rad,
            movement=self._autopilot.movement,
        )
        self._downlink.take(telemetry)
        if self.now_s >= self._frame_count / self._profile.video_rate_hz - TIME_SLACK_S:
            self._capture(telemetry)

    def _capture(self, telemetry: DroneState) -> None:
        motion = self.motion
        # The lens is ahead of the centre, so it moves with the body's tilt; the view does not tilt.
        x_m, y_m = motion.to_world(CAMERA_FORWARD_M * math.cos(motion.pitch_rad), 0.0)
        camera = CameraPose(
            x_m=x_m,
            y_m=y_m,
            z_m=motion.z_m + CAMERA_FORWARD_M * math.sin(motion.pitch_rad),
            yaw_rad=motion.yaw_rad,
            pitch_rad=self.gimbal_pitch_rad,
        )
        self.frames.append(
            Capture(
                index=self._frame_count,
                time_s=self.now_s,
                camera=camera,
                movers=self.movers,
                exposure=1.0 + self._exposure.step(),
                telemetry=telemetry,
            )
        )
        self._frame_count += 1
