"""A scripted SDK that answers like a drone, without Olympe."""

from __future__ import annotations

import enum
import threading
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any, Self

import numpy as np

from sim_bridge.olympe import AnafiConfig
from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.olympe.drone import OlympeDrone
from sim_bridge.olympe.sdk import Sdk
from sim_bridge.olympe.video import FrameClock

# Settings that the bridge changes, by command: event, argument of the event, first value.
SETTINGS: dict[str, tuple[str, str, Any]] = {
    "ardrone3.PilotingSettings.MaxTilt": (
        *("ardrone3.PilotingSettingsState.MaxTiltChanged", "current"),
        20.0,
    ),
    "ardrone3.PilotingSettings.MaxAltitude": (
        *("ardrone3.PilotingSettingsState.MaxAltitudeChanged", "current"),
        30.0,
    ),
    "ardrone3.SpeedSettings.MaxVerticalSpeed": (
        *("ardrone3.SpeedSettingsState.MaxVerticalSpeedChanged", "current"),
        1.0,
    ),
    "ardrone3.SpeedSettings.MaxRotationSpeed": (
        *("ardrone3.SpeedSettingsState.MaxRotationSpeedChanged", "current"),
        40.0,
    ),
    "ardrone3.PilotingSettings.BankedTurn": (
        *("ardrone3.PilotingSettingsState.BankedTurnChanged", "state"),
        1,
    ),
    "rth.set_auto_trigger_mode": ("rth.auto_trigger_mode", "mode", "on"),
}
LEVEL = {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}


class Kind(enum.Enum):
    CMD = 0
    EVT = 1


class Time:
    """A simulated wall clock, and a condition variable whose wait only advances this clock."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.on_wait: Callable[[], None] | None = None  # called during a wait

    def __call__(self) -> float:
        return self.now_s

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        return

    def notify_all(self) -> None:
        return

    def wait(self, timeout: float) -> None:
        if self.on_wait is not None:
            self.on_wait()
        else:
            self.now_s += max(timeout, 1e-6)  # a real wait is never zero


class Answer:
    """The SDK's expectation of an answer; waiting for a missing one blocks."""

    def __init__(self, *, good: bool) -> None:
        self._good = good

    def wait(self, _timeout: float) -> Answer:
        if not self._good:
            threading.Event().wait(_timeout)
        return self

    def success(self) -> bool:
        return self._good


class FakeFrame:
    """The SDK's frame, which is valid between `ref` and `unref`."""

    def __init__(
        self, planes: np.ndarray, meta: Mapping[str, Any] | None = None, **info: Any
    ) -> None:
        self.references = 0
        self._planes = planes
        self._meta = dict(meta or {})
        self._info = {
            "raw": {
                "frame": {
                    "format": info.get("format", "YUV420/ABCD/LINEAR/8/PLANAR/HIGH/BE/8"),
                    "info": {
                        "full_range": info.get("full_range", False),
                        "matrix_coefs": info.get("matrix_coefs", "BT709"),
                    },
                }
            },
            "ntp_raw_timestamp": info.get("ntp_raw_timestamp", 0),
        }

    def ref(self) -> None:
        self.references += 1

    def unref(self) -> None:
        self.references -= 1

    def info(self) -> Mapping[str, Any]:
        return self._info

    def as_ndarray(self) -> np.ndarray | None:
        return self._planes if self.references else None

    def vmeta(self) -> tuple[int, Mapping[str, Any]]:
        return 6, self._meta


class FakeStreaming:
    def __init__(self, drone: FakeSdkDrone) -> None:
        self._drone = drone
        self.given: dict[str, Any] = {}
        self.callbacks: dict[str, Any] = {}

    def set_callbacks(self, **callbacks: Any) -> None:
        self.callbacks = callbacks

    def play(self, **given: Any) -> bool:
        self.given = given
        if not self._drone.world.video:
            raise self._drone.world.video_fault  # as the SDK if RTSP is refused
        self._drone.world.on_video(self._drone)
        return True

    def play_multiple_stream(self, *, streams_list: list[Any], **given: Any) -> bool:
        (callback,) = streams_list
        return self.play(raw_cb=callback, **given)

    def stop(self) -> bool:
        self._drone.closed.append("stop video")
        return True

    @property
    def raw_cb(self) -> Callable[[Any], None]:
        callback: Callable[[Any], None] = self.given.get("raw_cb") or self.callbacks["raw_cb"]
        return callback


class FakeSdkDrone:
    """An object of the SDK's `Drone` that records all commands."""

    def __init__(self, world: FakeWorld, host: str, **given: Any) -> None:
        self.world, self.host, self.given = world, host, given
        self.connected = False
        self.sent: list[tuple[str, dict[str, Any]]] = []
        self.streaming = FakeStreaming(self)
        self.closed: list[str] = []
        self._listeners: list[Callable[[Any, Any], None]] = []
        world.made.append(self)

    def subscribe(self, callback: Callable[[Any, Any], None], expectation: None) -> None:
        assert expectation is None
        self._listeners.append(callback)

    def connect(self) -> bool:
        self.world.on_connect(self)
        for command in SETTINGS.keys() - self.world.unreported:
            event, argument, value = SETTINGS[command]
            self.event(event, **{argument: value})
        self.connected = self.world.answers
        return self.connected

    def disconnect(self) -> bool:
        self.closed.append("disconnect")
        return True

    def destroy(self) -> None:
        self.closed.append("destroy")

    def __call__(self, message: tuple[str, dict[str, Any]]) -> Answer:
        self.sent.append(message)
        name, args = message
        self.event(name, kind=Kind.CMD, **args)
        if name in SETTINGS.keys() - self.world.refused:
            event, argument, _ = SETTINGS[name]
            (value,) = args.values()
            self.event(event, **{argument: value})
        return Answer(good=name not in self.world.refused)

    def piloting(self, roll: int, pitch: int, yaw: int, gaz: int, piloting_time: float) -> bool:
        self.sent.append(("piloting", {"sticks": (roll, pitch, yaw, gaz), "for_s": piloting_time}))
        return self.world.steers

    def stop_piloting(self) -> bool:
        self.sent.append(("stop_piloting", {}))
        return True

    def event(self, name: str, /, kind: Kind = Kind.EVT, **args: Any) -> None:
        message = SimpleNamespace(fullName=name, message_type=kind)
        for listener in self._listeners:
            listener(SimpleNamespace(message=message, args=args), None)

    def names(self) -> list[str]:
        return [name.rpartition(".")[2] for name, _ in self.sent]


class FakeWorld:
    """The drones behind the SDK, with and without answers and video."""

    def __init__(self, version: tuple[int, ...] = (8, 5, 0)) -> None:
        self.answers = True
        self.video = True
        self.video_fault: BaseException = TimeoutError()
        self.steers = True
        self.refused: set[str] = set()  # settings that the drone does not confirm
        self.unreported: set[str] = set()  # settings that the drone does not report on connecting
        self.made: list[FakeSdkDrone] = []
        self.on_connect: Callable[[FakeSdkDrone], None] = lambda _: None
        self.on_video: Callable[[FakeSdkDrone], None] = lambda _: None
        self.sdk = Sdk(
            version=version,
            classes=SimpleNamespace(
                Drone=lambda host, **given: FakeSdkDrone(self, host, **given),
                SkyController3=lambda host, **given: FakeSdkDrone(self, host, sky=True, **given),
            ),
            message=lambda name: lambda **args: (name, args),
            stream=lambda on_frame: on_frame,
        )

    @property
    def drone(self) -> FakeSdkDrone:
        return self.made[-1]


class InTurn:
    """A command queue that runs each command at once."""

    def submit(self, kind: object, job: Callable[[], object]) -> None:
        assert kind is not None
        job()

    def run(self, job: Callable[[], object], limit_s: float) -> bool:
        assert limit_s > 0.0
        job()
        return True

    def close(self, *last: Callable[[], object]) -> None:
        for job in last:
            job()


def config(**changes: Any) -> OlympeConfig:
    return AnafiConfig(address="127.0.0.1", **changes)


def bridge(
    world: FakeWorld, time: Time | None = None, *, remote: bool = False, **changes: Any
) -> OlympeDrone:
    time = time or Time()
    return OlympeDrone(
        config(**changes),
        sdk=lambda: world.sdk,
        probe_first=lambda _: remote,
        clock=FrameClock(monotonic=time, condition=time),  # type: ignore[arg-type]
        commands=InTurn,
    )
