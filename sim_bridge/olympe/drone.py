"""`OlympeDrone`: an ANAFI as a `Drone`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, Final

from sim_bridge.anafi import anafi_camera
from sim_bridge.olympe.commands import CommandQueue, Job, Kind
from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.olympe.link import OlympeLink
from sim_bridge.olympe.media import fetch_photo
from sim_bridge.olympe.moves import MoveLedger
from sim_bridge.olympe.probe import probe
from sim_bridge.olympe.sdk import Sdk, load_sdk
from sim_bridge.olympe.speed import SpeedHolder
from sim_bridge.olympe.stills import OlympeStills
from sim_bridge.olympe.telemetry import STANDING_M, Telemetry
from sim_bridge.olympe.video import FrameClock, NewestFrame
from uav_bt.errors import DroneError
from uav_bt.types import (
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

_SAME_PITCH_RAD: Final = 1e-3  # rad; chosen: 1/20 degree. Smaller changes are not sent.
_MIN_PITCH_RAD: Final = -math.pi / 2  # rad, straight down; the end stop of the gimbal (Parrot)
_FRAME_RATE_HZ: Final = 30.0  # frame rate of the ANAFI's stream
# States in which a take-off or a landing need not be commanded (again).
_UP: Final = frozenset(set(FlyingState) - {FlyingState.LANDED, FlyingState.LANDING})
_DOWN: Final = frozenset({FlyingState.LANDED, FlyingState.LANDING, FlyingState.EMERGENCY})


@dataclass(kw_only=True)
class _Flight:
    """Objects that exist while connected."""

    link: OlympeLink
    telemetry: Telemetry
    frames: NewestFrame
    commands: CommandQueue
    speed: SpeedHolder
    stills: OlympeStills
    ordered_s: dict[str, float] = field(default_factory=dict)  # times of commands without effect
    prepared: bool = False  # whether the drone's limits are set
    pitch_rad: float | None = None  # the gimbal's last target


class OlympeDrone:
    """Flies an ANAFI, real or simulated by Sphinx; implements `Drone` and `Photographing`.

    Args:
        config: address, limits and timeouts.
        sdk: loads Parrot's SDK; tests pass a scripted one.
        probe_first: returns whether a remote control answers; raises an error if nothing answers.
        clock: the live clock.
        commands: makes the command queue.
    """

    def __init__(
        self,
        config: OlympeConfig,
        *,
        sdk: Callable[[], Sdk] = load_sdk,
        probe_first: Callable[[OlympeConfig], bool] = probe,
        clock: FrameClock | None = None,
        commands: Callable[[], CommandQueue] = CommandQueue,
    ) -> None:
        self._config = config
        self._sdk = sdk
        self._probe = probe_first
        self._commands = commands
        self.clock = clock or FrameClock()  # real time, with a tick at each frame
        # The nominal intrinsics of the video; a camera file is more accurate.
        self.camera = anafi_camera(*config.image_size_px)
        self.airframe = config.airframe
        self.scene: Final = None  # only simulated drones have a scene
        self.referee: Final = None  # only simulated drones have ground truth
        self.live = True  # a real drone is checked before it takes off
        self.tick_s = 1.0 / _FRAME_RATE_HZ
        self._flight: _Flight | None = None

    def connect(self) -> None:
        """Connect and start the video, which takes seconds; the drone's settings do not change.

        Raises:
            MissingDependencyError: Parrot's SDK is not installed.
            DroneError: the drone cannot be reached, or sends no video.
            InputError: the installed SDK cannot use the ports of the configuration.
        """
        if self._flight is not None:
            return
        config, clock = self._config, self.clock
        sdk = self._sdk()  # first, so that a missing SDK is reported before a missing drone
        config = replace(config, remote_control=self._probe(config))
        telemetry = Telemetry(
            clock.now,
            take_off_surface_m=config.take_off_surface_m,
            return_home=config.return_home,
        )
        frames = NewestFrame(
            config.image_size_px,
            clock.now,
            latency_s=config.video_latency_s,
            arrived=clock.frame_arrived,
        )
        commands = self._commands()

        def take_event(name: str, args: Mapping[str, Any]) -> None:
            telemetry.take(name, args)
            stills.take(name, args)

        link = OlympeLink(
            sdk,
            config,
            commands,
            now=clock.now,
            on_event=take_event,
            on_frame=frames.take,
        )
        stills = OlympeStills(
            link.orders,
            lambda job: commands.submit(Kind.CAMERA, job),
            lambda media, limit_s: fetch_photo(*link.web_address(), media, limit_s),
        )
        link.open()
        self._flight = _Flight(
            link=link,
            telemetry=telemetry,
            frames=frames,
            commands=commands,
            speed=SpeedHolder(config),
            stills=stills,
        )

    @property
    def stills(self) -> OlympeStills | None:
        """The camera's own photographs; None before connecting."""
        return None if self._flight is None else self._flight.stills

    def observe(self) -> Observation:
        """Return the newest frame and state with their capture times.

        Raises:
            DroneError: not connected.
        """
        flight = self._connected()
        self.clock.frame_seen()
        link = flight.link
        link.check_settings()
        flight.stills.advance()
        state = replace(flight.telemetry.state(), connected=link.connected, lost=link.lost)
        above_ground_m = self._config.take_off_surface_m + STANDING_M
        return Observation(frame=flight.frames.newest(state, above_ground_m), state=state)

    def send(self, command: Command) -> Command:
        """Send the changes of a command; return the command as it was sent.

        Raises:
            DroneError: not connected, or the SDK refused an earlier command.
        """
        flight = self._connected()
        movement, gimbal = command.movement, command.gimbal
        if isinstance(movement, Velocity):
            movement = flight.speed.limited(movement)
        if gimbal is not None:
            gimbal = GimbalTo(pitch_rad=max(_MIN_PITCH_RAD, min(0.0, gimbal.pitch_rad)))
            self._point(flight, gimbal.pitch_rad)
        self._move(flight, movement)
        return replace(command, movement=movement, gimbal=gimbal)

    def disconnect(self) -> None:
        """Disconnect; the firmware then controls the drone. Safe to call twice."""
        flight, self._flight = self._flight, None
        if flight is not None:
            with suppress(DroneError):  # raised for an earlier command
                flight.stills.give_up()
            flight.link.close()

    def _point(self, flight: _Flight, pitch_rad: float) -> None:
        known = flight.pitch_rad
        if known is None or abs(known - pitch_rad) > _SAME_PITCH_RAD:
            flight.pitch_rad = pitch_rad
            flight.commands.submit(Kind.GIMBAL, lambda: flight.link.orders.point(pitch_rad))

    def _move(self, flight: _Flight, movement: Movement) -> None:
        orders, submit = flight.link.orders, flight.commands.submit
        if isinstance(movement, CutMotors):
            submit(Kind.END, orders.cut_motors)
            return
        if isinstance(movement, Land):
            flight.speed.reset()
            # First: the other commands may fail.
            self._repeat(flight, Kind.END, "land", orders.land, done=_is_in(flight, _DOWN))
            submit(Kind.STICKS, orders.let_go)
            self._take_sticks(flight)
            return
        if isinstance(movement, Release):
            flight.speed.reset()
            self._stop_moving(flight)
            submit(Kind.STICKS, orders.let_go)
            self._lend_sticks(flight)
            return
        self._take_sticks(flight)
        if isinstance(movement, Velocity):
            self._steer(flight, movement)
            return
        flight.speed.reset()
        if isinstance(movement, MoveBy):
            self._start(flight, movement)
        elif isinstance(movement, TakeOff):
            self._prepare(flight)
            self._repeat(flight, Kind.MOVE, "take off", orders.take_off, done=_is_in(flight, _UP))
        else:
            self._stop_moving(flight)
            submit(Kind.STICKS, orders.centre)

    def _steer(self, flight: _Flight, order: Velocity) -> None:
        state = flight.telemetry.state()
        if state.flying not in {FlyingState.HOVERING, FlyingState.FLYING}:
            return
        self._prepare(flight)
        self._stop_moving(flight)
        sticks = flight.speed.sticks(order, state.velocity, self.clock.now())
        flight.commands.submit(Kind.STICKS, lambda: flight.link.orders.steer(sticks))

    def _start(self, flight: _Flight, move: MoveBy) -> None:
        self._prepare(flight)
        at_speed = flight.telemetry.has_extended_moves

        def begin(moves: MoveLedger) -> None:
            if not moves.is_latest(move):
                moves.sent(move)
                flight.commands.submit(
                    Kind.MOVE, lambda: flight.link.orders.move(move, at_speed=at_speed)
                )

        flight.telemetry.with_moves(begin)

    def _stop_moving(self, flight: _Flight) -> None:
        if flight.telemetry.moving:
            flight.telemetry.with_moves(MoveLedger.halted)
            flight.commands.submit(Kind.MOVE, flight.link.orders.halt)

    def _prepare(self, flight: _Flight) -> None:
        """Set the drone's limits before its first movement."""
        if flight.prepared:
            return
        flight.prepared = True
        config = self._config
        # A movement without speeds uses the largest tilt.
        extended = flight.telemetry.has_extended_moves
        tilt_rad = config.tilt_limit_rad if extended else config.gentle_tilt_rad
        flight.speed.tilt_limit_rad = tilt_rad
        flight.commands.submit(Kind.LIMITS, lambda: flight.link.prepare(tilt_rad=tilt_rad))

    def _lend_sticks(self, flight: _Flight) -> None:
        """Give control to the pilot of a remote control, if this program has it."""
        telemetry = flight.telemetry
        if telemetry.has_sticks and not telemetry.lent:
            telemetry.lend()
            flight.commands.submit(Kind.CONTROL, flight.link.orders.give_sticks)

    def _take_sticks(self, flight: _Flight) -> None:
        """Take control back if it was given; do not take it if the pilot took it."""
        telemetry = flight.telemetry
        if telemetry.shares_sticks:
            self._repeat(
                flight,
                Kind.CONTROL,
                "sticks",
                flight.link.orders.take_sticks,
                done=not telemetry.lent,
            )

    def _repeat(self, flight: _Flight, kind: Kind, what: str, order: Job, *, done: bool) -> None:
        """Send a command; repeat it after `order_repeat_s` while it has no effect."""
        now_s = self.clock.now()
        if done:
            flight.ordered_s.pop(what, None)
        elif now_s - flight.ordered_s.get(what, -math.inf) > self._config.order_repeat_s:
            flight.ordered_s[what] = now_s
            flight.commands.submit(kind, order)

    def _connected(self) -> _Flight:
        if self._flight is None:
            raise DroneError(f"{self._config.where} is not connected: call connect() first")
        return self._flight


def _is_in(flight: _Flight, states: frozenset[FlyingState]) -> bool:
    return flight.telemetry.state().flying in states
