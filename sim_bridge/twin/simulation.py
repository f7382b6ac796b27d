"""Simulation of the twin: physics, autopilot, sensors and gimbal, stepped together."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from sim_bridge.anafi import CAMERA_FORWARD_M
from sim_bridge.twin.autopilot import Autopilot
from sim_bridge.twin.body import CONTROL_STEP_S, Body
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.downlink import Downlink, Events
from sim_bridge.twin.noise import NormalStream, OrnsteinUhlenbeck, child_seed
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.reference import Pace
from sim_bridge.twin.routes import Traffic
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.sensors import Sensors, Telemetry
from uav_bt.errors import ValueRangeError
from uav_bt.types import Command, DroneState, MoveBy, MoverState, Pose
from uav_bt.types.pose import clamp

_REMEMBERED_FRAMES = 900  # 30 s of video, for the referee
_CONTACT_MEMORY_S = 0.1  # one tick: a reader once a tick gets all contacts
_TIME_SLACK_S = 1e-6


@dataclass(frozen=True, kw_only=True, slots=True)
class Capture:
    """Camera, movers and telemetry at one time, to render the frame later."""

    index: int
    time_s: float
    camera: CameraPose
    movers: tuple[MoverState, ...]
    exposure: float  # relative brightness
    telemetry: Telemetry


class Simulation:
    """One flight. On one machine the same seed and commands give the same flight.

    Time passes only in `run_until`.

    Args:
        scene: the lab.
        body: the drone in the physics of that lab.
        profile: limits and imperfections.
        seed: random seed of the flight.
        start: pose of the body's centre before take-off.
    """

    def __init__(self, scene: Scene, body: Body, profile: Profile, seed: int, start: Pose) -> None:
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
        gusts = NormalStream(child_seed(seed, 3))
        self._wind = [
            OrnsteinUhlenbeck(
                std=profile.wind_std_mps2,
                time_s=profile.wind_time_s,
                step_s=CONTROL_STEP_S,
                stream=gusts,
            )
            for _ in range(3)
        ]
        self._breeze = (0.0, 0.0)  # steady acceleration by the wind, m/s2, world x and y
        self._exposure = OrnsteinUhlenbeck(
            std=profile.exposure_std,
            time_s=profile.exposure_time_s,
            step_s=1.0 / profile.video_rate_hz,
            stream=NormalStream(child_seed(seed, 4)),
        )
        self._gimbal_rad = 0.0
        self._gimbal_target_rad = 0.0
        self._touched_s: dict[str, float] = {}
        self._pilot = False
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

    @property
    def gimbal_pitch_rad(self) -> float:
        """Pitch of the camera; 0 level, negative down."""
        return self._gimbal_rad

    @property
    def pilot_has_control(self) -> bool:
        """Whether a pilot flies."""
        return self._pilot

    @pilot_has_control.setter
    def pilot_has_control(self, value: bool) -> None:
        if value and not self._pilot:
            self._autopilot.take_over()
        self._pilot = value

    def disturb(self, *, wind_mps2: tuple[float, float], drift_mps: tuple[float, float]) -> None:
        """Apply a steady wind and a steady drift that the estimate misses, from now on."""
        self._breeze = wind_mps2
        self._sensors.drift_mps = drift_mps

    def enqueue(self, command: Command, pace: Pace | None = None) -> None:
        """Send a command; it takes effect after the computing and transmission delays.

        Args:
            command: the command.
            pace: speed limits of a `MoveBy`; None uses the limits of the profile.
        """
        delay = self._profile.compute_latency_s + self._profile.command_latency_s
        self._queue.append((self.now_s + delay, command, pace))

    def run_until(self, time_s: float) -> None:
        """Advance to a time in control steps; a past time has no effect."""
        while self.now_s < time_s - _TIME_SLACK_S:
            self._step()

    def state(self) -> DroneState:
        """Return the telemetry that has arrived."""
        heard = self._downlink.heard
        return DroneState(
            captured_s=heard.times.oldest_s,
            flying=heard.events.flying,
            attitude=heard.attitude,
            velocity=heard.velocity,
            altitude_m=heard.altitude_m,
            height_m=heard.height_m,
            height_above_ground_m=heard.height_above_ground_m,
            gimbal_pitch_rad=heard.gimbal_pitch_rad,
            battery=max(0.0, 1.0 - self.now_s / self._profile.battery_life_s),
            movement=heard.events.movement,
            pilot_has_control=self._pilot,
            measured=heard.times,
        )

    def contacts(self) -> tuple[str, ...]:
        """Return the names of the geoms that the hull touched in the last 0.1 s with motors on."""
        since = self.now_s - _CONTACT_MEMORY_S - _TIME_SLACK_S
        return tuple(sorted(name for name, at in self._touched_s.items() if at >= since))

    def _step(self) -> None:
        while self._queue and self._queue[0][0] <= self.now_s + _TIME_SLACK_S:
            _, command, pace = self._queue.popleft()
            self._obey(command, pace)
        demand = self._autopilot.update(
            self._estimate,
            height_m=self.motion.z_m - self._surface_m,
            touching=bool(self._touching),
        )
        if demand is None:
            self.body.drop()
        else:
            (x, y), (gust_x, gust_y, gust_z) = self._breeze, (each.step() for each in self._wind)
            wind = (gust_x + x, gust_y + y, gust_z)
            self.body.fly(
                self.motion, demand.acceleration_mps2, demand.yaw_acceleration_radps2, wind
            )
        self._move_gimbal()
        self._steps += 1
        self.movers = self._traffic.at(self.now_s)
        self.body.place_movers(self.movers)
        self.body.advance()
        self._sense()

    def _obey(self, command: Command, pace: Pace | None) -> None:
        if command.gimbal is not None:
            self._gimbal_target_rad = command.gimbal.pitch_rad
        if not self._pilot:
            self._autopilot.obey(command.movement, self._estimate, pace)
        elif isinstance(command.movement, MoveBy):
            self._autopilot.refuse(command.movement)

    def _move_gimbal(self) -> None:
        profile = self._profile
        error = self._gimbal_target_rad - self._gimbal_rad
        rate = error / max(profile.gimbal_lag_s, CONTROL_STEP_S)
        rate = clamp(rate, profile.gimbal_rate_radps)
        self._gimbal_rad += rate * CONTROL_STEP_S

    def _sense(self) -> None:
        """Measure after a step: motion, contacts, telemetry, and a frame if due."""
        self.motion = motion = self.body.motion()
        self._touching = self.body.contacts()
        if self.motors_on:
            for name in self._touching:
                self._touched_s[name] = self.now_s
        elif self._touched_s:
            self._touched_s.clear()
        self._estimate = self._sensors.estimate(motion, airborne=self._autopilot.lifting)
        self._surface_m = self._surface_at(motion)
        self._telemetry = self._sensors.telemetry(motion, self._estimate, self._surface_m)
        events = Events(flying=self._autopilot.flying_state, movement=self._autopilot.movement)
        self._downlink.take(self._telemetry, self._gimbal_rad, events, self.now_s)
        if self.now_s >= self._frame_count / self._profile.video_rate_hz - _TIME_SLACK_S:
            self._capture()

    def capture_of(self, index: int) -> Capture:
        """Return the capture of a frame.

        Args:
            index: number of the frame.

        Raises:
            ValueRangeError: the frame is older than 30 s, or was not captured yet.
        """
        first = self.frames[0].index
        if 0 <= index - first < len(self.frames):
            return self.frames[index - first]
        raise ValueRangeError(
            f"frame {index} is not among the remembered frames {first} to "
            f"{self.frames[-1].index}; ask within 30 s of its capture"
        )

    def _surface_at(self, body: Pose) -> float:
        """Return the height of the surface below the body, movers included."""
        return self._scene.surface_m(body.x_m, body.y_m, body.z_m, self.movers)

    def _capture(self) -> None:
        motion = self.motion
        # The lens is ahead of the centre, so it moves with the body's tilt; the view does not tilt.
        x_m, y_m = motion.to_world(CAMERA_FORWARD_M * math.cos(motion.pitch_rad), 0.0)
        self.frames.append(
            Capture(
                index=self._frame_count,
                time_s=self.now_s,
                camera=CameraPose(
                    x_m=x_m,
                    y_m=y_m,
                    z_m=motion.z_m + CAMERA_FORWARD_M * math.sin(motion.pitch_rad),
                    yaw_rad=motion.yaw_rad,
                    pitch_rad=self._gimbal_rad,
                ),
                movers=self.movers,
                exposure=1.0 + self._exposure.step(),
                telemetry=self._telemetry,
            )
        )
        self._frame_count += 1
