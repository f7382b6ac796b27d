"""A world without physics for tests of the loopback ANAFI; time passes on demand."""

from __future__ import annotations

import math
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from typing import Any

from sim_bridge.loopback.codec import Received, decode
from sim_bridge.loopback.firmware.anafi import Anafi
from sim_bridge.loopback.firmware.camera import Shutter
from sim_bridge.loopback.firmware.telemetry_events import BatteryOptions
from sim_bridge.loopback.media import MediaStore, Photo
from sim_bridge.loopback.messages import MessageType, message_table
from sim_bridge.loopback.world import Location, WorldLimits, WorldState
from sim_bridge.twin.reference import Pace
from uav_bt.types import (
    Attitude,
    BodyVelocity,
    CutMotors,
    FlyingState,
    Hover,
    Land,
    MoveBy,
    Movement,
    MovementState,
    MovementStatus,
    TakeOff,
    Velocity,
    wrap_angle,
)

STEP_S = 0.02


class FakeWorld:
    """Motors start in 0.5 s, take-off takes 0.5 s, landing 1 s; at most 1 m/s and 1 rad/s."""

    def __init__(self, limits: WorldLimits | None = None) -> None:
        self.limits = limits or WorldLimits(max_speed_mps=2.0, max_climb_mps=1.0)
        self.orders: list[Movement] = []
        self.stuck = False
        self.pace = Pace(speed_mps=1.0, climb_mps=1.0, yaw_rate_radps=1.0)  # of the last `MoveBy`
        self._state = WorldState()
        self._order: Movement = Hover()
        self._since_s = 0.0
        self._left = (0.0, 0.0, 0.0, 0.0)
        self._heading_rad = 0.0  # heading at the start of a movement

    def state(self) -> WorldState:
        return self._state

    def move(self, movement: Movement, pace: Pace | None = None) -> None:
        self.orders.append(movement)
        if pace is not None:
            self.pace = pace
        status = self._state.movement
        if status is not None and status.state is MovementState.RUNNING:
            self._set(movement=replace(status, state=MovementState.INTERRUPTED))
        flying = self._state.flying in (FlyingState.HOVERING, FlyingState.FLYING)
        if isinstance(movement, TakeOff) and self._state.flying is FlyingState.LANDED:
            self._set(flying=FlyingState.TAKING_OFF)
        elif isinstance(movement, Land) and self._state.flying is not FlyingState.LANDED:
            self._set(flying=FlyingState.LANDING)
        elif isinstance(movement, CutMotors) and self._state.flying is not FlyingState.LANDED:
            self._set(flying=FlyingState.EMERGENCY)
        elif isinstance(movement, MoveBy):
            running = MovementState.RUNNING if flying else MovementState.REJECTED
            self._set(movement=MovementStatus(id=movement.id, state=running))
            self._heading_rad = self._state.attitude.yaw_rad
            self._left = (
                movement.forward_m,
                movement.right_m,
                movement.down_m,
                movement.yaw_rad,
            )
        if not (isinstance(movement, Velocity) and isinstance(self._order, Velocity)):
            self._since_s = self._state.time_s
        self._order = movement

    def point(self, pitch_rad: float) -> None:
        self._set(gimbal_pitch_rad=pitch_rad)

    def advance(self, step_s: float = STEP_S) -> None:
        self._set(time_s=self._state.time_s + step_s)
        elapsed = self._state.time_s - self._since_s
        flying = self._state.flying
        if flying is FlyingState.TAKING_OFF:
            self._set(lifting=elapsed > 0.5, altitude_m=max(0.0, min(1.0, elapsed - 0.5)))
            if elapsed > 1.5:
                self._set(flying=FlyingState.HOVERING)
        elif flying in (FlyingState.LANDING, FlyingState.EMERGENCY):
            if elapsed > 1.0:
                self._set(flying=FlyingState.LANDED, lifting=False, altitude_m=0.0)
        elif flying is not FlyingState.LANDED:
            self._fly(step_s)

    def _fly(self, step_s: float) -> None:
        order, velocity, turn = self._order, BodyVelocity(), 0.0
        if isinstance(order, Velocity):
            velocity = BodyVelocity(
                forward_mps=order.forward_mps,
                right_mps=order.right_mps,
                down_mps=order.down_mps,
            )
            turn = order.yaw_rate_radps
        elif isinstance(order, MoveBy) and not self.stuck:
            pace = self.pace
            paces = (pace.speed_mps, pace.speed_mps, pace.climb_mps, pace.yaw_rate_radps)
            limits = [min(1.0, limit) for limit in paces]
            size = max(abs(part) / limit for part, limit in zip(self._left, limits, strict=True))
            share = min(1.0, step_s / size) if size else 1.0
            done = [part * share for part in self._left]
            self._left = tuple(part - gone for part, gone in zip(self._left, done, strict=True))
            velocity = BodyVelocity(
                forward_mps=done[0] / step_s,
                right_mps=done[1] / step_s,
                down_mps=done[2] / step_s,
            )
            turn = done[3] / step_s
        self._shift(velocity, turn, step_s)
        status = self._state.movement
        arrived = max(map(abs, self._left)) < 1e-9 and not self.stuck
        if isinstance(order, MoveBy) and status is not None and arrived:
            self._set(movement=replace(status, state=MovementState.DONE))
            self._order = Hover()
        still = not isinstance(self._order, (MoveBy, Velocity))
        self._set(flying=FlyingState.HOVERING if still else FlyingState.FLYING)

    def _shift(self, velocity: BodyVelocity, turn: float, step_s: float) -> None:
        yaw = self._state.attitude.yaw_rad
        heading = self._heading_rad if isinstance(self._order, MoveBy) else yaw
        cosine, sine = math.cos(heading), math.sin(heading)
        north = velocity.forward_mps * cosine - velocity.right_mps * sine
        east = velocity.forward_mps * sine + velocity.right_mps * cosine
        self._set(
            velocity=velocity,
            north_m=self._state.north_m + north * step_s,
            east_m=self._state.east_m + east * step_s,
            altitude_m=self._state.altitude_m - velocity.down_mps * step_s,
            attitude=Attitude(yaw_rad=wrap_angle(yaw + turn * step_s)),
        )

    def _set(self, **changes: Any) -> None:
        self._state = replace(self._state, **changes)


PHOTO = Photo(
    jpeg=b"\xff\xd8 a photograph \xff\xd9",
    thumbnail=b"\xff\xd8 small \xff\xd9",
    size_px=(640, 360),
    taken_utc_s=1_529_154_916.0,
    location=Location(latitude_deg=48.0, longitude_deg=2.0, altitude_m=40.0),
)


def taken(photo: Photo | Exception = PHOTO) -> Shutter:
    """Return a camera that takes this photograph at once, or fails with this error."""

    def shoot() -> Future[Photo]:
        future: Future[Photo] = Future()
        if isinstance(photo, Exception):
            future.set_exception(photo)
        else:
            future.set_result(photo)
        return future

    return shoot


@dataclass
class Bench:
    """The firmware in a fake world, and all events that it sent."""

    battery: BatteryOptions = field(default_factory=BatteryOptions)
    world: FakeWorld = field(default_factory=FakeWorld)
    events: list[Received] = field(default_factory=list)
    gps: bool = True
    shoot: Shutter | None = field(default_factory=taken)
    media: MediaStore = field(default_factory=MediaStore)

    def __post_init__(self) -> None:
        self.anafi = Anafi(
            self.world,
            message_table(),
            battery=self.battery,
            gps=self.gps,
            shoot=self.shoot,
            media=self.media,
        )
        self.connect()

    def connect(self) -> None:
        self.anafi.connected(self._hear)

    def _hear(self, message: MessageType, payload: bytes) -> None:
        assert message.event
        self.events.append(decode(payload, message_table()))

    def send(self, name: str, /, **values: Any) -> None:
        message = message_table().named(name)
        self.anafi.handle(Received(type=message, values=values))

    def run(self, duration_s: float) -> None:
        for _ in range(round(duration_s / STEP_S)):
            self.world.advance()
            self.anafi.update()

    def fly(self) -> None:
        self.send("ardrone3.Piloting.TakeOff")
        self.run(2.0)
        self.events.clear()

    def values(self, name: str) -> list[dict[str, Any]]:
        return [dict(one.values) for one in self.events if one.type.name == name]

    def names(self) -> list[str]:
        return [one.type.name for one in self.events]

    def flying_states(self) -> list[str]:
        event = "ardrone3.PilotingState.FlyingStateChanged"
        return [values["state"] for values in self.values(event)]
