"""A scripted SDK that answers like a drone, without Olympe."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from sim_bridge.olympe import AnafiConfig
from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.olympe.drone import OlympeDrone
from sim_bridge.olympe.sdk import Sdk
from sim_bridge.olympe.video import FrameClock
from uav_bt.types import Command, DroneState, Movement

PATIENCE_S = 30.0  # for what should happen at once
STATE = "ardrone3.PilotingState"
FLYING = f"{STATE}.FlyingStateChanged"
MAX_TILT = "ardrone3.PilotingSettings.MaxTilt"
MAX_ALTITUDE = "ardrone3.PilotingSettings.MaxAltitude"
CLIMB = "ardrone3.SpeedSettings.MaxVerticalSpeed"
ROTATION = "ardrone3.SpeedSettings.MaxRotationSpeed"
BANKED_TURN = "ardrone3.PilotingSettings.BankedTurn"
RETURN_HOME = "rth.set_auto_trigger_mode"
# Settings that the bridge changes, by command: event, argument of the event, first value.
SETTINGS: dict[str, tuple[str, str, Any]] = {
    MAX_TILT: ("ardrone3.PilotingSettingsState.MaxTiltChanged", "current", 20.0),
    MAX_ALTITUDE: ("ardrone3.PilotingSettingsState.MaxAltitudeChanged", "current", 30.0),
    CLIMB: ("ardrone3.SpeedSettingsState.MaxVerticalSpeedChanged", "current", 1.0),
    ROTATION: ("ardrone3.SpeedSettingsState.MaxRotationSpeedChanged", "current", 40.0),
    BANKED_TURN: ("ardrone3.PilotingSettingsState.BankedTurnChanged", "state", 1),
    RETURN_HOME: ("rth.auto_trigger_mode", "mode", "on"),
}
MEASURED: dict[str, tuple[str, dict[str, float]]] = {
    "attitude": ("AttitudeChanged", {"roll": 0.0, "pitch": 0.0, "yaw": 0.0}),
    "velocity": ("SpeedChanged", {"speedX": 0.35, "speedY": 0.0, "speedZ": 0.0}),
    "altitude": ("AltitudeChanged", {"altitude": 1.5}),
}


class Time(FrameClock):
    """A simulated clock, which only a script advances."""

    now_s = 0.0

    def now(self) -> float:
        return self.now_s


class FakeFrame:
    """The SDK's frame of grey pixels, which is valid between `ref` and `unref`."""

    references = 0

    def __init__(
        self, meta: Mapping[str, Any] | None = None, level: int = 99, stream_us: int = 0
    ) -> None:
        self.meta, self.stream_us = dict(meta or {}), stream_us
        self.planes = np.full((36, 32), 128, np.uint8)
        self.planes[:24] = level

    def ref(self) -> None:
        self.references += 1

    def unref(self) -> None:
        self.references -= 1

    def info(self) -> Mapping[str, Any]:
        raw = {"format": "YUV420/ABCD/LINEAR/8/PLANAR/HIGH/BE/8", "info": {}}
        return {"raw": {"frame": raw}, "ntp_raw_timestamp": self.stream_us}

    def as_ndarray(self) -> np.ndarray | None:
        return self.planes if self.references else None

    def vmeta(self) -> tuple[int, Mapping[str, Any]]:
        return 6, self.meta


@dataclass
class FakeWorld:
    """The drones behind the SDK, with and without answers and video."""

    version: tuple[int, ...] = (8, 5, 0)
    firmware: str = "1.6.9"
    answers: bool = True
    steers: bool = True
    video_fault: BaseException | None = None
    refused: set[str] = field(default_factory=set)  # settings that the drone does not confirm
    unreported: set[str] = field(default_factory=set)  # settings not reported on connecting
    blocks: str = ""  # name of a call of the SDK that blocks until `go`
    fails: str = ""  # name of a call that fails
    on_connect: Callable[[FakeSdkDrone], object] = lambda _: None
    go: threading.Event = field(default_factory=threading.Event)
    destroyed: threading.Event = field(default_factory=threading.Event)
    made: list[FakeSdkDrone] = field(default_factory=list)

    def sdk(self) -> Sdk:
        return Sdk(
            version=self.version,
            classes=SimpleNamespace(
                Drone=partial(FakeSdkDrone, self),
                SkyController3=partial(FakeSdkDrone, self, sky=True),
            ),
            message=lambda name: lambda **args: (name, args),
            stream=lambda on_frame: on_frame,
        )


class FakeSdkDrone:
    """An object of the SDK's `Drone`, and its `streaming`, that records all commands."""

    def __init__(self, world: FakeWorld, host: str, **given: Any) -> None:
        self.world, self.host, self.given = world, host, given
        self.connected = False
        self.streaming = self
        self.sent: list[tuple[str, dict[str, Any]]] = []
        self.calls: list[tuple[str, int]] = []  # with the calling thread
        self.played: dict[str, Any] = {}
        self.on_frame: Callable[[Any], None]
        self._listeners: list[Callable[[Any, Any], None]] = []
        world.made.append(self)
        self._note("make")

    def _note(self, call: str) -> bool:
        self.calls.append((call, threading.get_ident()))
        if call == self.world.blocks:
            assert self.world.go.wait(PATIENCE_S)
        if call == self.world.fails:
            raise TimeoutError("no answer")
        return True

    @property
    def closed(self) -> list[str]:
        """The calls that end the connection."""
        return [call for call, _ in self.calls if call in {"stop", "disconnect", "destroy"}]

    def names(self) -> list[str]:
        """Return the names of all commands."""
        return [name.rpartition(".")[2] for name, _ in self.sent]

    def args(self, name: str) -> list[dict[str, Any]]:
        """Return the arguments of all commands of a name."""
        return [args for sent, args in self.sent if sent == name]

    def subscribe(self, callback: Callable[[Any, Any], None], expectation: None) -> None:
        assert expectation is None
        self._note("subscribe")
        self._listeners.append(callback)

    def connect(self) -> bool:
        self._note("connect")
        version = "common.SettingsState.ProductVersionChanged"
        self.event(version, software=self.world.firmware, hardware="1")
        self.world.on_connect(self)
        for command in SETTINGS.keys() - self.world.unreported:
            event, argument, value = SETTINGS[command]
            self.event(event, **{argument: value})
        self.connected = self.world.answers
        return self.connected

    def set_callbacks(self, *, raw_cb: Callable[[Any], None]) -> None:
        self.on_frame = raw_cb

    def play(self, **given: Any) -> bool:
        self.played = given
        self._note("play")
        if self.world.video_fault is not None:
            raise self.world.video_fault  # as the SDK if RTSP is refused
        return True

    def play_multiple_stream(self, *, streams_list: list[Any], **given: Any) -> bool:
        (self.on_frame,) = streams_list
        return self.play(**given)

    def stop(self) -> bool:
        return self._note("stop")

    def disconnect(self) -> bool:
        return self._note("disconnect")

    def destroy(self) -> None:
        self._note("destroy")
        self.world.destroyed.set()

    def __call__(self, message: tuple[str, dict[str, Any]]) -> None:
        self._note("send")
        self.sent.append(message)
        name, args = message
        self.event(name, kind="CMD", **args)
        if name in SETTINGS.keys() - self.world.refused:
            event, argument, _ = SETTINGS[name]
            (value,) = args.values()
            self.event(event, **{argument: value})

    def piloting(self, roll: int, pitch: int, yaw: int, gaz: int, piloting_time: float) -> bool:
        self._note("piloting")
        self.sent.append(("piloting", {"sticks": (roll, pitch, yaw, gaz), "for_s": piloting_time}))
        return self.world.steers

    def stop_piloting(self) -> bool:
        self.sent.append(("stop_piloting", {}))
        return self._note("stop_piloting")

    def event(self, name: str, /, kind: str = "EVT", **args: Any) -> None:
        message = SimpleNamespace(fullName=name, message_type=SimpleNamespace(name=kind))
        for listener in self._listeners:
            listener(SimpleNamespace(message=message, args=args), None)

    def measures(self, silent: str = "") -> None:
        """Report attitude, velocity and altitude, or two of them."""
        for quantity, (name, values) in MEASURED.items():
            if quantity != silent:
                self.event(f"{STATE}.{name}", **values)


class InTurn:
    """A command queue that runs each command at once."""

    hangs = False

    def submit(self, _kind: object, job: Callable[[], object]) -> None:
        job()

    def run(self, job: Callable[[], object], limit_s: float) -> bool:
        assert limit_s > 0.0
        job()
        return True

    def close(self, *last: Callable[[], object]) -> None:
        for job in last:
            job()


def config(**changes: Any) -> OlympeConfig:
    return AnafiConfig(**{"address": "127.0.0.1", **changes})


class Flight:
    """A drone whose commands are carried out at once, in simulated time; connected."""

    def __init__(
        self,
        world: FakeWorld | None = None,
        *,
        remote: bool = False,
        threaded: bool = False,
        connect: bool = True,
        **changes: Any,
    ) -> None:
        self.world, self.time = world or FakeWorld(), Time()
        in_turn: Any = {} if threaded else {"clock": self.time, "commands": InTurn}
        self.drone = OlympeDrone(
            config(**changes), sdk=self.world.sdk, probe_first=lambda _: remote, **in_turn
        )
        if connect:
            self.drone.connect()

    @property
    def sdk(self) -> FakeSdkDrone:
        """The latest of the SDK's objects."""
        return self.world.made[-1]

    @property
    def state(self) -> DroneState:
        return self.drone.observe().state

    def play(self, *steps: Movement | float | str) -> list[str]:
        """Play a script; return the names of all commands so far.

        It has movements, pauses in seconds, and states that the drone reports: flying states and
        piloting sources.
        """
        for step in steps:
            if isinstance(step, float):
                self.time.now_s += step
            elif step in {"Controller", "SkyController"}:
                self.sdk.event("skyctrl.CoPilotingState.pilotingSource", source=step)
            elif isinstance(step, str):
                self.sdk.event(FLYING, state=step)
            else:
                self.drone.send(Command(movement=step))
        return self.sdk.names()
