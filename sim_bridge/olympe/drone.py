"""`OlympeDrone`: an ANAFI as the mission sees it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from sim_bridge.anafi import anafi_camera
from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.olympe.courier import Courier, Job
from sim_bridge.olympe.link import OlympeLink
from sim_bridge.olympe.moves import MoveLedger
from sim_bridge.olympe.pace import FrameClock
from sim_bridge.olympe.probe import probe
from sim_bridge.olympe.sdk import Sdk, load_sdk
from sim_bridge.olympe.speed import SpeedHolder
from sim_bridge.olympe.telemetry import STANDING_M, Telemetry
from sim_bridge.olympe.video import NewestFrame
from uav_bt.errors import DroneError
from uav_bt.types import (
    CameraModel,
    Command,
    CutMotors,
    FlyingState,
    GimbalTo,
    Land,
    MoveBy,
    Movement,
    Observation,
    Release,
    TakeOff,
    Velocity,
)

__all__ = ["OlympeDrone"]

_REPEAT_S: Final = 1.0  # take-off and landing are told again when nothing came of them
_SAME_PITCH_RAD: Final = 1e-3
_CLOSE_LIMIT_S: Final = 3.0
_LOWEST_RAD: Final = -math.pi / 2
# Where there is nothing left to take off or to land.
_UP: Final = frozenset(set(FlyingState) - {FlyingState.LANDED, FlyingState.LANDING})
_DOWN: Final = frozenset({FlyingState.LANDED, FlyingState.LANDING, FlyingState.EMERGENCY})


@dataclass(kw_only=True)
class _Flight:
    """What exists while connected."""

    link: OlympeLink
    telemetry: Telemetry
    frames: NewestFrame
    courier: Courier
    speed: SpeedHolder
    told: tuple[Movement, float] | None = None  # the last take-off or landing, and when
    pitch_rad: float | None = None  # the last the gimbal was told


class OlympeDrone:
    """Flies an ANAFI, real or simulated by Sphinx; implements the `Drone` protocol.

    Args:
        config: where it is and what it keeps to.
        sdk: gets Parrot's SDK; tests give a scripted one.
        probe_first: asks whether anybody is there.
        clock: the live clock.
        courier: makes what carries the commands.
    """

    def __init__(
        self,
        config: OlympeConfig,
        *,
        sdk: Callable[[], Sdk] = load_sdk,
        probe_first: Callable[[OlympeConfig], None] = probe,
        clock: FrameClock | None = None,
        courier: Callable[[], Courier] = Courier,
    ) -> None:
        self._config = config
        self._sdk = sdk
        self._probe = probe_first
        self._courier = courier
        self._clock = clock or FrameClock()
        self._camera = anafi_camera(*config.image_size_px)
        self._flight: _Flight | None = None

    @property
    def clock(self) -> FrameClock:
        """The wall's time since the drone was made; it ticks with the frames."""
        return self._clock

    @property
    def live(self) -> bool:
        """It is checked before it takes off."""
        return True

    @property
    def tick_s(self) -> float:
        """The shortest tick: frames come at most so often."""
        return 1.0 / 30.0

    @property
    def camera(self) -> CameraModel:
        """The nominal intrinsics of its video; a camera file knows better."""
        return self._camera

    @property
    def referee(self) -> None:
        """Nobody knows the truth about a real drone."""
        return

    def connect(self) -> None:
        """Connect, set the limits, and start the video; seconds, whatever goes wrong.

        Raises:
            MissingDependencyError: Parrot's SDK is not installed.
            DroneError: the drone cannot be reached, or gives no video.
            InputError: the installed SDK cannot use the ports that were asked for.
        """
        if self._flight is not None:
            return
        config, clock = self._config, self._clock
        sdk = self._sdk()
        self._probe(config)
        telemetry = Telemetry(clock.now, take_off_surface_m=config.take_off_surface_m)
        frames = NewestFrame(
            config.image_size_px,
            clock.now,
            latency_s=config.video_latency_s,
            arrived=clock.frame_arrived,
        )
        link = OlympeLink(sdk, config, on_event=telemetry.take, on_picture=frames.take)
        try:
            link.open()
        except BaseException:
            link.close()
            raise
        self._flight = _Flight(
            link=link,
            telemetry=telemetry,
            frames=frames,
            courier=self._courier(),
            speed=SpeedHolder(config),
        )

    def observe(self) -> Observation:
        """Return the newest frame and state; old ones keep the time they are from.

        Raises:
            DroneError: not connected.
        """
        flight = self._connected()
        self._clock.frame_seen()
        state = flight.telemetry.state()
        above_carpet_m = self._config.take_off_surface_m + STANDING_M
        return Observation(frame=flight.frames.newest(state, above_carpet_m), state=state)

    def send(self, command: Command) -> Command:
        """Tell the drone what it was not told yet; return the command as it was sent.

        Raises:
            DroneError: not connected, or the SDK refused an earlier command.
        """
        flight = self._connected()
        movement, gimbal = command.movement, command.gimbal
        if isinstance(movement, Velocity):
            movement = flight.speed.limited(movement)
        if gimbal is not None:
            gimbal = GimbalTo(pitch_rad=max(_LOWEST_RAD, min(0.0, gimbal.pitch_rad)))
            self._point(flight, gimbal.pitch_rad)
        self._move(flight, movement)
        return replace(command, movement=movement, gimbal=gimbal)

    def disconnect(self) -> None:
        """Let go; the drone hovers or flies on by its own rules. Safe to call twice."""
        flight, self._flight = self._flight, None
        if flight is not None:
            flight.courier.close(_CLOSE_LIMIT_S)
            flight.link.close()

    def _point(self, flight: _Flight, pitch_rad: float) -> None:
        known = flight.pitch_rad
        if known is None or abs(known - pitch_rad) > _SAME_PITCH_RAD:
            flight.pitch_rad = pitch_rad
            flight.courier.give(lambda: flight.link.point(pitch_rad))

    def _move(self, flight: _Flight, movement: Movement) -> None:
        link, give = flight.link, flight.courier.give
        if isinstance(movement, Velocity):
            state = flight.telemetry.state()
            if state.flying in {FlyingState.HOVERING, FlyingState.FLYING}:
                self._stop_moving(flight)
                sticks = flight.speed.sticks(movement, state.velocity, self._clock.now())
                give(lambda: link.steer(sticks))
            return
        flight.speed.reset()
        if isinstance(movement, MoveBy):
            self._start(flight, movement)
        elif isinstance(movement, TakeOff):
            self._repeat(flight, movement, link.take_off, until=_UP)
        elif isinstance(movement, Land):
            give(link.let_go)
            self._repeat(flight, movement, link.land, until=_DOWN)
        elif isinstance(movement, CutMotors):
            give(link.cut_motors)
        elif isinstance(movement, Release):
            self._stop_moving(flight)
            give(link.let_go)
        else:
            self._stop_moving(flight)
            give(link.centre)

    def _start(self, flight: _Flight, move: MoveBy) -> None:
        def begin(moves: MoveLedger) -> None:
            if not moves.is_latest(move):
                moves.told(move)
                flight.courier.give(lambda: flight.link.move(move))

        flight.telemetry.with_moves(begin)

    def _stop_moving(self, flight: _Flight) -> None:
        if flight.telemetry.moving:
            flight.telemetry.with_moves(MoveLedger.halted)
            flight.courier.give(flight.link.halt)

    def _repeat(
        self, flight: _Flight, movement: Movement, tell: Job, *, until: frozenset[FlyingState]
    ) -> None:
        now_s = self._clock.now()
        if flight.telemetry.state().flying in until:
            return
        if flight.told is None or flight.told[0] != movement or now_s - flight.told[1] > _REPEAT_S:
            flight.told = movement, now_s
            flight.courier.give(tell)

    def _connected(self) -> _Flight:
        if self._flight is None:
            raise DroneError(f"{self._config.where} is not connected: call connect() first")
        return self._flight
