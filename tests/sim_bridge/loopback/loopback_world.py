"""The loopback ANAFI's firmware on the twin, whose time passes on demand."""

from __future__ import annotations

from concurrent.futures import Future
from functools import cache
from typing import Any

from sim_bridge.loopback.codec import Message, decode, message_types
from sim_bridge.loopback.firmware.anafi import Anafi
from sim_bridge.loopback.firmware.remote_control import RemoteControl
from sim_bridge.loopback.media import Card, MediaStore, Photo
from sim_bridge.loopback.twin_world import TwinWorld
from sim_bridge.loopback.world import WorldState
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene_file import load_scene
from uav_bt.clock import ManualClock
from uav_bt.types import FlyingState

STEP_S = 0.02
Order = tuple[str, dict[str, Any]]
Step = str | Order | float | FlyingState


@cache
def full_name(end: str) -> str:
    """Return the name of the only message whose name ends so, as in `Piloting.TakeOff`."""
    (name,) = (one for one in message_types() if f".{one}".endswith(f".{end}"))
    return name


class Bench:
    """The firmware on the twin, and all events that it sent; messages have their short names."""

    def __init__(
        self,
        scene: str | None = None,
        *,
        profile: str = "ideal",
        charge: float = 1.0,
        card: Card = Card.READY,
        remote: bool = False,
    ) -> None:
        self.clock, self.media = ManualClock(), MediaStore(card)
        lab = None if scene is None else load_scene(scene)
        self.world = TwinWorld(lab, Profile.named(profile), 1, self.clock)
        self.photo: Future[Photo] = Future()  # the photograph that is taken next
        self.anafi = Anafi(self.world, shoot=lambda: self.photo, media=self.media, charge=charge)
        self.firmware = RemoteControl(self.anafi, self.world) if remote else self.anafi
        self.events: list[Message] = []
        self.connect()

    @property
    def state(self) -> WorldState:
        return self.world.state()

    def connect(self) -> None:
        self.firmware.connected(lambda payload, _acked: self.events.append(decode(payload)))

    def send(self, name: str, /, **values: Any) -> None:
        self.firmware.handle(Message(name=full_name(name), values=values))

    def run(self, duration_s: float) -> None:
        for _ in range(round(duration_s / STEP_S)):
            self.clock.advance(STEP_S)
            self.world.catch_up()
            self.firmware.update()

    def run_until(self, flying: FlyingState, limit_s: float = 120.0) -> None:
        """Let time pass until the drone is in this state."""
        for _ in range(round(limit_s / STEP_S)):
            if self.state.flying is flying:
                return
            self.run(STEP_S)
        raise AssertionError(f"not {flying} within {limit_s} s: {self.state}")

    def play(self, *steps: Step) -> None:
        """Send commands, let seconds pass, and wait for states."""
        for step in steps:
            if isinstance(step, FlyingState):
                self.run_until(step)
            elif isinstance(step, float):
                self.run(step)
            else:
                name, values = (step, {}) if isinstance(step, str) else step
                self.send(name, **values)

    def fly(self) -> None:
        """Take off, and forget the events."""
        self.play("TakeOff", FlyingState.HOVERING, 0.5)
        self.events.clear()

    def sticks(self, duration_s: float, flag: int = 1, **percent: int) -> None:
        """Hold the sticks for a time, as clients do."""
        for _ in range(max(1, round(duration_s / 0.1))):
            self.play(sticks(flag, **percent), 0.1)

    def values(self, name: str, argument: str | None = None) -> list[Any]:
        """Return the values of all events of a name, or those of one argument."""
        found = [dict(one.values) for one in self.events if one.name == full_name(name)]
        return found if argument is None else [one[argument] for one in found]

    def names(self) -> list[str]:
        return [one.name for one in self.events]

    def flying_states(self) -> list[str]:
        return self.values("FlyingStateChanged", "state")


def sticks(flag: int = 1, **percent: int) -> Order:
    centred = {"roll": 0, "pitch": 0, "yaw": 0, "gaz": 0, "timestampAndSeqNum": 0}
    return "PCMD", {"flag": flag, **centred, **percent}


def move_by(dx: float = 0.0, dy: float = 0.0, dz: float = 0.0, dpsi: float = 0.0) -> Order:
    return "moveBy", {"dX": dx, "dY": dy, "dZ": dz, "dPsi": dpsi}
