"""`OlympeDrone`: an ANAFI as a `Drone`."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Final

from sim_bridge.anafi import anafi_camera
from sim_bridge.olympe import orders
from sim_bridge.olympe.commands import CommandQueue, Kind
from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.olympe.link import OlympeLink
from sim_bridge.olympe.orders import Order
from sim_bridge.olympe.probe import probe
from sim_bridge.olympe.sdk import Sdk, load_sdk
from sim_bridge.olympe.speed import SpeedHolder, gentle_tilt_rad
from sim_bridge.olympe.stills import OlympeStills
from sim_bridge.olympe.telemetry import PILOT
from sim_bridge.olympe.video import FrameClock
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

_FRAME_RATE_HZ: Final = 30.0  # of the ANAFI's stream
# Time after which a take-off or landing without effect is repeated. Chosen: the SDK drops a packet
# without acknowledgement after 0.9 s.
_REPEAT_S: Final = 1.0
_SAME_PITCH_RAD: Final = 1e-3  # chosen: 1/20 degree. Smaller changes are not sent.
_MIN_PITCH_RAD: Final = -math.pi / 2  # straight down; the end stop of the gimbal (Parrot)
# States in which a take-off or a landing need not be commanded (again).
_UP: Final = frozenset(set(FlyingState) - {FlyingState.LANDED, FlyingState.LANDING})
_DOWN: Final = frozenset({FlyingState.LANDED, FlyingState.LANDING, FlyingState.EMERGENCY})
_STEERABLE: Final = frozenset({FlyingState.HOVERING, FlyingState.FLYING})


class OlympeDrone:
    """Flies an ANAFI, real or simulated by Sphinx; implements `Drone` and `Photographing`.

    Tests pass a scripted SDK, probe and command queue.
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
        self._pilot: _Pilot | None = None

    def connect(self) -> None:
        """Connect and start the video, which takes seconds; the drone's settings do not change.

        Raises:
            MissingDependencyError: Parrot's SDK is not installed.
            DroneError: the drone cannot be reached, or sends no video.
            InputError: the installed SDK cannot use the ports of the configuration.
        """
        if self._pilot is None:
            sdk = self._sdk()  # first, so that a missing SDK is reported before a missing drone
            remote = self._probe(self._config)
            link = OlympeLink(sdk, self._config, self._commands(), self.clock, remote=remote)
            link.open()
            self._pilot = _Pilot(self._config, link, self.clock)

    @property
    def stills(self) -> OlympeStills | None:
        """The camera's own photographs; None before connecting."""
        return None if self._pilot is None else self._pilot.link.stills

    def observe(self) -> Observation:
        """Return the newest frame and state with their capture times."""
        self.clock.frame_seen()
        return self._connected().link.observe()

    def send(self, command: Command) -> Command:
        """Send the changes of a command; return the command as it was sent.

        Raises:
            DroneError: not connected, or the SDK refused an earlier command.
        """
        return self._connected().send(command)

    def disconnect(self) -> None:
        """Disconnect; the firmware then controls the drone. Safe to call twice."""
        pilot, self._pilot = self._pilot, None
        if pilot is not None:
            with suppress(DroneError):  # raised for an earlier command
                pilot.link.stills.give_up()
            pilot.link.close()

    def _connected(self) -> _Pilot:
        if self._pilot is None:
            raise DroneError(f"{self._config.where} is not connected: call connect() first")
        return self._pilot


class _Pilot:
    """Sends the changes of commands, on the thread of the mission, without waiting for the SDK."""

    def __init__(self, config: OlympeConfig, link: OlympeLink, clock: FrameClock) -> None:
        self._config = config
        self._clock = clock
        self.link = link
        self._submit = link.commands.submit
        self._telemetry = link.telemetry
        self._speed = SpeedHolder(config)
        self._prepared = False  # whether the drone's limits are set
        self._pitch_rad = math.inf  # the gimbal's last target
        self._ordered_s: dict[str, float] = {}  # times of commands without effect

    def send(self, command: Command) -> Command:
        """Send the changes of a command; return the command as it was sent."""
        movement, gimbal = command.movement, command.gimbal
        if isinstance(movement, Velocity):
            movement = self._speed.limited(movement)
        if gimbal is not None:
            gimbal = GimbalTo(pitch_rad=max(_MIN_PITCH_RAD, min(0.0, gimbal.pitch_rad)))
            if abs(self._pitch_rad - gimbal.pitch_rad) > _SAME_PITCH_RAD:
                self._pitch_rad = gimbal.pitch_rad
                self._send(Kind.GIMBAL, orders.point(gimbal.pitch_rad))
        self._move(movement)
        return replace(command, movement=movement, gimbal=gimbal)

    def _move(self, movement: Movement) -> None:
        link = self.link
        if isinstance(movement, CutMotors):
            self._send(Kind.END, orders.EMERGENCY)
            return
        if isinstance(movement, Land):
            self._speed.reset()
            # First: the other commands may fail.
            if self._is_due("land", done=self._flying in _DOWN):
                self._submit(Kind.END, link.land)
            self._submit(Kind.STICKS, link.let_go)
            self._take_sticks()
            return
        if isinstance(movement, Release):
            self._speed.reset()
            self._stop_moving()
            self._submit(Kind.STICKS, link.let_go)
            self._lend_sticks()
            return
        self._take_sticks()
        if isinstance(movement, Velocity):
            self._steer(movement)
            return
        self._speed.reset()
        if isinstance(movement, MoveBy):
            self._start(movement)
        elif isinstance(movement, TakeOff):
            self._prepare()
            if self._is_due("take off", done=self._flying in _UP):
                self._send(Kind.MOVE, orders.TAKE_OFF)
        else:
            self._stop_moving()
            self._submit(Kind.STICKS, link.centre)

    @property
    def _flying(self) -> FlyingState:
        return self._telemetry.known.flying

    def _steer(self, order: Velocity) -> None:
        if self._flying in _STEERABLE:
            self._prepare()
            self._stop_moving()
            measured, full = self._telemetry.state().velocity, self.link.settings.full_sticks()
            sticks = self._speed.sticks(order, measured, self._clock.now(), full)
            self._submit(Kind.STICKS, lambda: self.link.steer(sticks))

    def _start(self, move: MoveBy) -> None:
        self._prepare()
        if self._telemetry.moves.begin(move):
            extended = self._telemetry.known.has_extended_moves
            order = orders.move_at_speed(move, self._config) if extended else orders.move_by(move)
            self._submit(Kind.MOVE, lambda: self.link.move(order))

    def _stop_moving(self) -> None:
        if self._telemetry.moves.halt():
            self._send(Kind.MOVE, orders.HALT)

    def _prepare(self) -> None:
        """Set the drone's limits before its first movement."""
        if self._prepared:
            return
        self._prepared = True
        if not self._telemetry.known.has_extended_moves:  # a movement then uses the largest tilt
            self._speed.tilt_limit_rad = gentle_tilt_rad(self._config)
        self._submit(Kind.LIMITS, lambda: self.link.settings.change(self._speed.tilt_limit_rad))

    def _lend_sticks(self) -> None:
        """Give control to the pilot of a remote control, if this program has it."""
        telemetry = self._telemetry
        if telemetry.known.source not in (None, PILOT) and not telemetry.lent:
            telemetry.lent = True
            self._send(Kind.CONTROL, orders.GIVE_STICKS)

    def _take_sticks(self) -> None:
        """Take control back if it was given; do not take it if the pilot took it."""
        shared = self._telemetry.known.source is not None
        if shared and self._is_due("sticks", done=not self._telemetry.lent):
            self._send(Kind.CONTROL, orders.TAKE_STICKS)

    def _is_due(self, what: str, *, done: bool) -> bool:
        """Return whether to send a command, at first or because it had no effect; note its time."""
        now_s = self._clock.now()
        if done:
            self._ordered_s.pop(what, None)
        elif now_s - self._ordered_s.get(what, -math.inf) > _REPEAT_S:
            self._ordered_s[what] = now_s
            return True
        return False

    def _send(self, kind: Kind, order: Order) -> None:
        self._submit(kind, lambda: self.link.send(order))
