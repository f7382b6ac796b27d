"""`OlympeDrone`: an ANAFI behind the `Drone` protocol."""

from __future__ import annotations

import math
import queue
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from sim_bridge.anafi import anafi_camera
from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.olympe.link import OlympeLink, probe
from sim_bridge.olympe.sdk import Sdk, load_sdk
from sim_bridge.olympe.speed import SpeedHolder
from sim_bridge.olympe.telemetry import STANDING_M, MoveLedger, Telemetry
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

_SAME_PITCH_RAD: Final = 1e-3  # smaller changes of the gimbal are not sent
_MIN_PITCH_RAD: Final = -math.pi / 2
# States in which a take-off or a landing need not be ordered (again).
_UP: Final = frozenset(set(FlyingState) - {FlyingState.LANDED, FlyingState.LANDING})
_DOWN: Final = frozenset({FlyingState.LANDED, FlyingState.LANDING, FlyingState.EMERGENCY})


Job = Callable[[], object]


class CommandQueue:
    """Runs commands in order on a thread of its own: some calls of the SDK block."""

    def __init__(self) -> None:
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._fault: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="olympe commands", daemon=True)
        self._thread.start()

    def submit(self, job: Job) -> None:
        """Queue a command.

        Raises:
            Exception: whatever an earlier command raised, once; this one is queued all the same,
                since it may be the landing.
        """
        self._jobs.put(job)
        fault, self._fault = self._fault, None
        if fault is not None:
            raise fault

    def close(self, limit_s: float) -> None:
        """Take no more commands; return when those queued are done, or after a time, s."""
        self._jobs.put(None)
        self._thread.join(limit_s)

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            try:
                job()
            except Exception as error:  # noqa: BLE001  # raised by the next `submit`
                self._fault = error


@dataclass(kw_only=True)
class _Flight:
    """What exists while connected."""

    link: OlympeLink
    telemetry: Telemetry
    frames: NewestFrame
    commands: CommandQueue
    speed: SpeedHolder
    last_order: tuple[Movement, float] | None = None  # take-off or landing, and when
    pitch_rad: float | None = None  # the gimbal's last target


class OlympeDrone:
    """Flies an ANAFI, real or simulated by Sphinx; implements the `Drone` protocol.

    Args:
        config: address, limits and time-outs.
        sdk: loads Parrot's SDK; tests give a scripted one.
        probe_first: raises if there is no drone at the address.
        clock: the live clock.
        commands: makes the queue of the commands.
    """

    def __init__(
        self,
        config: OlympeConfig,
        *,
        sdk: Callable[[], Sdk] = load_sdk,
        probe_first: Callable[[OlympeConfig], None] = probe,
        clock: FrameClock | None = None,
        commands: Callable[[], CommandQueue] = CommandQueue,
    ) -> None:
        self._config = config
        self._sdk = sdk
        self._probe = probe_first
        self._commands = commands
        self.clock = clock or FrameClock()  # real time; it ticks with the frames
        # The nominal intrinsics of its video; a camera file is more accurate.
        self.camera = anafi_camera(*config.image_size_px)
        self.scene: Final = None  # only simulated places are known
        self.referee: Final = None  # there is no truth about a real drone
        self.live = True  # a real drone is checked before it takes off
        self.tick_s = 1.0 / 30.0  # frames do not come faster
        self._flight: _Flight | None = None

    def connect(self) -> None:
        """Connect, set the limits, and start the video; takes seconds, also where it fails.

        Raises:
            MissingDependencyError: Parrot's SDK is not installed.
            DroneError: the drone cannot be reached, or gives no video.
            InputError: the installed SDK cannot use the ports that were asked for.
        """
        if self._flight is not None:
            return
        config, clock = self._config, self.clock
        sdk = self._sdk()
        self._probe(config)
        telemetry = Telemetry(clock.now, take_off_surface_m=config.take_off_surface_m)
        frames = NewestFrame(
            config.image_size_px,
            clock.now,
            latency_s=config.video_latency_s,
            arrived=clock.frame_arrived,
        )
        link = OlympeLink(sdk, config, on_event=telemetry.take, on_frame=frames.take)
        try:
            link.open()
        except BaseException:
            link.close()
            raise
        self._flight = _Flight(
            link=link,
            telemetry=telemetry,
            frames=frames,
            commands=self._commands(),
            speed=SpeedHolder(config),
        )

    def observe(self) -> Observation:
        """Return the newest frame and state; old ones keep their capture times.

        Raises:
            DroneError: not connected.
        """
        flight = self._connected()
        self.clock.frame_seen()
        state = flight.telemetry.state()
        above_carpet_m = self._config.take_off_surface_m + STANDING_M
        return Observation(frame=flight.frames.newest(state, above_carpet_m), state=state)

    def send(self, command: Command) -> Command:
        """Send the drone what is new in a command; return it as it was sent.

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
        """Disconnect; the drone then follows its own rules. Safe to call twice."""
        flight, self._flight = self._flight, None
        if flight is not None:
            flight.commands.close(self._config.command_limit_s)
            flight.link.close()

    def _point(self, flight: _Flight, pitch_rad: float) -> None:
        known = flight.pitch_rad
        if known is None or abs(known - pitch_rad) > _SAME_PITCH_RAD:
            flight.pitch_rad = pitch_rad
            flight.commands.submit(lambda: flight.link.point(pitch_rad))

    def _move(self, flight: _Flight, movement: Movement) -> None:
        link, submit = flight.link, flight.commands.submit
        if isinstance(movement, Velocity):
            state = flight.telemetry.state()
            if state.flying in {FlyingState.HOVERING, FlyingState.FLYING}:
                self._stop_moving(flight)
                sticks = flight.speed.sticks(movement, state.velocity, self.clock.now())
                submit(lambda: link.steer(sticks))
            return
        flight.speed.reset()
        if isinstance(movement, MoveBy):
            self._start(flight, movement)
        elif isinstance(movement, TakeOff):
            self._repeat(flight, movement, link.take_off, until=_UP)
        elif isinstance(movement, Land):
            submit(link.let_go)
            self._repeat(flight, movement, link.land, until=_DOWN)
        elif isinstance(movement, CutMotors):
            submit(link.cut_motors)
        elif isinstance(movement, Release):
            self._stop_moving(flight)
            submit(link.let_go)
        else:
            self._stop_moving(flight)
            submit(link.centre)

    def _start(self, flight: _Flight, move: MoveBy) -> None:
        def begin(moves: MoveLedger) -> None:
            if not moves.is_latest(move):
                moves.sent(move)
                flight.commands.submit(lambda: flight.link.move(move))

        flight.telemetry.with_moves(begin)

    def _stop_moving(self, flight: _Flight) -> None:
        if flight.telemetry.moving:
            flight.telemetry.with_moves(MoveLedger.halted)
            flight.commands.submit(flight.link.halt)

    def _repeat(
        self, flight: _Flight, movement: Movement, order: Job, *, until: frozenset[FlyingState]
    ) -> None:
        now_s = self.clock.now()
        if flight.telemetry.state().flying in until:
            return
        last = flight.last_order
        if last is None or last[0] != movement or now_s - last[1] > self._config.order_repeat_s:
            flight.last_order = movement, now_s
            flight.commands.submit(order)

    def _connected(self) -> _Flight:
        if self._flight is None:
            raise DroneError(f"{self._config.where} is not connected: call connect() first")
        return self._flight
