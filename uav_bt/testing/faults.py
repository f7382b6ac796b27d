"""Faults of drones, to test how missions react to them: as a text, and around a drone."""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Final, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import InputError, UnknownNameError, ValueRangeError
from uav_bt.landing_marks import MarkSighting
from uav_bt.mission.drone_wrapper import DroneWrapper
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import Drone, Referee, Sight
from uav_bt.testing.fault_kinds import FAULTS, FaultKind, FaultMoment
from uav_bt.types import ClassMap, Command, DepthMap, Frame, Observation, Pose2D

RANDOM: Final = "random"
"""In place of a fault: room, movers and faults are drawn from the seed."""
START: Final = "start"  # in place of a phase: from the connection on
_TEXT: Final = re.compile(
    r"(?P<kind>[\w-]+)(=(?P<level>[^@~]+))?"
    r"(@(?P<phase>[^+~=@]+)(\+(?P<delay>[^~]+))?)?(~(?P<duration>.+))?"
)


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A kind of fault with its level and its time."""

    kind: FaultKind
    level: float | None = None  # None: the kind's default
    phase: str = START  # it begins with the first tick of this phase of the mission
    delay_s: float = 0.0  # time from the start of the phase to the fault
    duration_s: float = math.inf  # from its first effect on

    def __post_init__(self) -> None:
        kind, level = self.kind, self.level
        if not (math.isfinite(self.delay_s) and self.delay_s >= 0.0):
            raise ValueRangeError(f"expected a delay of 0 s or more, got {self.delay_s:g}")
        if not self.duration_s > 0.0:
            raise ValueRangeError(
                f"expected a duration of more than 0 s, got {self.duration_s:g}; a fault without a "
                "duration stays"
            )
        if level is not None and kind.level is None:
            raise ValueRangeError(f"{kind.name} takes no level, got {level:g}")
        if level is not None and not (math.isfinite(level) and kind.least <= level <= kind.most):
            limits = f"{kind.least:g} to {kind.most:g} {kind.unit}".rstrip()
            raise ValueRangeError(f"expected a finite level from {limits}, got {level:g}")

    @classmethod
    def parse(cls, text: str, kinds: Mapping[str, FaultKind] = FAULTS) -> Self:
        """Return the fault that a text like ``late=0.7@explore+1~30`` describes.

        Args:
            text: ``KIND[=LEVEL][@PHASE[+DELAY]][~DURATION]``, times in seconds.
            kinds: by name.
        """
        found = _TEXT.fullmatch(text)
        if found is None:
            raise ValueRangeError(
                f"a fault is written KIND[=LEVEL][@PHASE[+DELAY]][~DURATION], got '{text}'"
            )
        if found["kind"] == RANDOM:
            raise ValueRangeError(f"'{RANDOM}' takes no level and no time, got '{text}'")
        if found["kind"] not in kinds:
            raise UnknownNameError("fault", found["kind"], [*kinds, RANDOM])
        try:
            return cls(
                kind=kinds[found["kind"]],
                level=None if found["level"] is None else _number("level", found["level"]),
                phase=found["phase"] or START,
                delay_s=_number("delay", found["delay"] or "0"),
                duration_s=_number("duration", found["duration"] or "inf"),
            )
        except ValueError as error:
            raise ValueRangeError(f"fault '{text}': {error}") from error

    def __str__(self) -> str:
        level = "" if self.level is None else f"={self.level:g}"
        delay = f"+{self.delay_s:g}" if self.delay_s else ""
        duration = f"~{self.duration_s:g}" if math.isfinite(self.duration_s) else ""
        return f"{self.kind.name}{level}@{self.phase}{delay}{duration}"


def _number(what: str, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise ValueRangeError(f"expected a number as {what}, got '{text}'") from error


# --- the drone ------------------------------------------------------------------------------------

_PAST: Final = 64  # kept observations for late frames: 6 s at the usual tick; chosen
_SLACK_S: Final = 1e-6  # rounding of times


@runtime_checkable
class Disturbed(Protocol):
    """A simulated drone that accepts disturbances."""

    def disturb(self, *, wind_mps2: tuple[float, float], drift_mps: tuple[float, float]) -> None:
        """Apply a steady wind, and a drift of the drone's estimate, from now on; world x and y."""
        ...


class FaultyDrone(DroneWrapper):
    """Flies another drone, which is not connected yet, with one fault.

    app.fly(tree, drone=FaultyDrone(twin, Fault.parse("video-lost@explore+1~30")))
    """

    def __init__(self, drone: Drone, fault: Fault) -> None:
        super().__init__(drone)
        self.fault = fault
        self.began_s: float | None = None  # mission time of the first effect; None before it
        self.body = drone  # the drone without faults
        # Present disturbances by the faults of one body: argument, and level along world x.
        self.disturbances: dict[FaultyDrone, tuple[str, float]] = {}
        if isinstance(drone, FaultyDrone):
            self.body, self.disturbances = drone.body, drone.disturbances
        if fault.kind.disturb is not None and not isinstance(self.body, Disturbed):
            raise InputError(
                f"fault '{fault.kind.name}' needs a drone with a method 'disturb', such as the "
                f"twin; {type(self.body).__name__} has none"
            )
        self._phase_s: float | None = None  # start of the fault's phase
        self._before: Observation | None = None
        self._still: Frame | None = None
        self._past: deque[Observation] = deque(maxlen=_PAST)
        self._command: Command | None = None
        # The delivered frame, and the camera's frame of the same image.
        self._shown: tuple[Frame, Frame] | None = None

    @property
    def missed(self) -> str | None:
        """The reason why the fault has had no effect; None once it has had one."""
        if self.began_s is not None:
            return None
        missed = "did not enter" if self._phase_s is None else "ended too early in"
        return f"the flight {missed} the phase '{self.fault.phase}'"

    @property
    def referee(self) -> Referee | None:
        """The inner drone's referee; its masks and depths match the delivered image."""
        inner = self._drone.referee
        return None if inner is None else _FaultyReferee(inner, self)

    @property
    def sight(self) -> Sight | None:
        """The inner drone's perception, of what the delivered image shows."""
        inner = super().sight
        return None if inner is None else _FaultySight(inner, self)

    def connect(self) -> None:
        """Connect the inner drone."""
        self._drone.connect()
        self._phase_s = self.clock.now() if self.fault.phase == START else None

    def observe(self) -> Observation:
        """Return the inner drone's observation as the fault changes it."""
        seen = self._drone.observe()
        self._past.append(seen)
        self._before, self._still = self._before or seen, self._still or seen.frame
        at, kind = self._moment(), self.fault.kind
        if kind.disturb is not None:
            self.disturbances[self] = kind.disturb, 0.0 if at is None else at.level
            totals = {"wind_mps2": 0.0, "drift_mps": 0.0}
            for name, level in self.disturbances.values():
                totals[name] += level
            if isinstance(self.body, Disturbed):
                self.body.disturb(**{name: (level, 0.0) for name, level in totals.items()})
        shown = seen
        if at is None:
            self._before, self._still = seen, seen.frame or self._still
        elif kind.observe is not None:
            with self._named():
                shown = kind.observe(seen, at)
        self._shown = None if shown.frame is None else (shown.frame, self._source(shown.frame))
        return shown

    def send(self, command: Command) -> Command:
        """Send a command as the fault changes it; return the mission's own command."""
        self._command = command
        kind = self.fault.kind
        # `_moment` begins the fault, and a change of observations must not begin before one.
        at = None if kind.send is None else self._moment()
        if at is None or kind.send is None:
            return self._drone.send(command)
        with self._named():
            changed = kind.send(command, at)
        sent = self._drone.send(changed)
        return sent if changed == command else command

    def on_tick(self, record: TickRecord) -> None:
        """Follow the flight's phase; `go_to` is `go to`."""
        here, wanted = (name.replace("_", " ") for name in (record.phase, self.fault.phase))
        if self._phase_s is None and here == wanted:
            self._phase_s = record.time_s
        follow = self.fault.kind.follow
        if follow is not None and self._moment() is not None:
            with self._named():
                follow()

    @contextmanager
    def _named(self) -> Iterator[None]:
        """Note the fault on an error that its effect raises."""
        try:
            yield
        except Exception as error:
            error.add_note(f"the injected fault {self.fault} raised this error")
            raise

    def source_of(self, frame: Frame) -> Frame:
        """Return the camera's frame whose image a delivered frame has."""
        if self._shown is not None and self._shown[0].image is frame.image:
            return self._shown[1]
        return frame

    def _source(self, shown: Frame) -> Frame:
        frames = [past.frame for past in self._past] + [self._still]
        same = (frame for frame in frames if frame is not None and frame.image is shown.image)
        return next(same, self._past[-1].frame or shown)

    def _moment(self) -> FaultMoment | None:
        """Return the inputs of the fault's effect; None while it has no effect."""
        fault, now_s = self.fault, self.clock.now()
        if self._phase_s is None or self._before is None:
            return None
        if now_s < self._phase_s + fault.delay_s - _SLACK_S:
            return None
        self.began_s = now_s if self.began_s is None else self.began_s
        since_s = now_s - self.began_s
        if since_s > 0.0 and since_s >= fault.duration_s - _SLACK_S:
            return None
        level = fault.kind.level if fault.level is None else fault.level
        return FaultMoment(
            level=math.nan if level is None else level,
            since_s=since_s,
            before=self._before,
            still=self._still,
            past=tuple(self._past),
            command=self._command,
        )


def find_faulty_drones(drone: Drone) -> list[FaultyDrone]:
    """Return the drones with a fault among a drone and those that it wraps, innermost first."""
    found: list[FaultyDrone] = []
    while isinstance(drone, DroneWrapper):
        if isinstance(drone, FaultyDrone):
            found.insert(0, drone)
        drone = drone.inner
    return found


class _FaultyReferee:
    """Referee whose masks and depths match the delivered frames."""

    def __init__(self, referee: Referee, drone: FaultyDrone) -> None:
        self.truth, self.ground = referee.truth, referee.ground
        self._referee, self._source_of = referee, drone.source_of

    def class_ids(self, frame: Frame, width_px: int, height_px: int) -> NDArray[np.uint8]:
        return self._referee.class_ids(self._source_of(frame), width_px, height_px)

    def depth(self, frame: Frame, width_px: int, height_px: int) -> NDArray[np.float32]:
        return self._referee.depth(self._source_of(frame), width_px, height_px)


class _FaultySight:
    """Perception without images that sees what the delivered frames show."""

    def __init__(self, sight: Sight, drone: FaultyDrone) -> None:
        self._sight, self._source_of = sight, drone.source_of

    def segment(self, frame: Frame) -> ClassMap:
        return replace(self._sight.segment(self._source_of(frame)), captured_s=frame.captured_s)

    def estimate(self, frame: Frame) -> DepthMap:
        return replace(self._sight.estimate(self._source_of(frame)), captured_s=frame.captured_s)

    def mark(self, frame: Frame) -> MarkSighting | None:
        return self._sight.mark(self._source_of(frame))

    def motion(self, first: Frame, second: Frame) -> Pose2D | None:
        return self._sight.motion(self._source_of(first), self._source_of(second))
