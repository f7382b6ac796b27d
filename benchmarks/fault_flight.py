"""One flight with one fault, watched from outside: what happened, and whether it was right."""

from __future__ import annotations

import json
import logging
import resource
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

from benchmarks.fault_reactions import Facts
from benchmarks.loopback_drone import loopback_address, served
from uav_bt import app
from uav_bt.app.site import Site
from uav_bt.errors import InputError
from uav_bt.mission.flight_report import FlightReport
from uav_bt.mission.judge import JudgeConfig
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import Drone
from uav_bt.testing.faults import FAULTS, Fault, FaultKind, FaultyDrone
from uav_bt.types import FlyingState, MissionPhase, Observation
from uav_bt.types.flight_results import EventKind
from uav_bt.types.mission_rules import LandOn

_AFTER_S: Final = 3.0  # the drone is watched for this time after the program's end
_MOTORS_OFF: Final = frozenset({FlyingState.LANDED, FlyingState.EMERGENCY})
# Of a loopback ANAFI: it takes off from a box in the lab.
_LAB: Final = Site(take_off_surface_m=0.4)
_RATE_HZ: Final = 15.0


def _fill_disk() -> None:
    """Let no file of this process grow; writing fails as it does on a full disk."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))


_DISK_FULL: Final = FaultKind(
    name="disk-full", what="nothing more can be written", follow=_fill_disk
)
KINDS: Final[Mapping[str, FaultKind]] = {**FAULTS, _DISK_FULL.name: _DISK_FULL}


@dataclass(frozen=True, kw_only=True)
class Case:
    """A flight to fly; equal cases give equal flights of the twin."""

    fault: str
    tree: str  # a file
    scene: str = "train-a"
    seed: int = 1
    drone: str = "twin"
    networks: bool = False  # masks of the tree's network instead of exact ones
    time_limit_s: float = 120.0
    on_pad: bool = True  # whether the mission is to end on the mark

    @property
    def parsed(self) -> Fault:
        """The fault as a value."""
        return Fault.parse(self.fault, KINDS)

    @property
    def exact_masks(self) -> bool:
        """Whether it is flown on exact masks, and on small images then."""
        images = self.drone != "plain" and self.address is None
        return images and not (self.networks or self.parsed.kind.in_image)

    @property
    def address(self) -> str | None:
        """Where the loopback ANAFI is served that is flown over Olympe, None for other drones.

        Raises:
            InputError: the address is not one of this machine alone.
        """
        return loopback_address(self.drone)

    def make_drone(self) -> WatchedDrone:
        """Return the drone with its fault, unconnected.

        Raises:
            InputError: drone, scene or seed cannot be used.
        """
        if self.address:
            options = app.FlightOptions(drone=self.drone, site=_LAB)
        else:
            options = app.FlightOptions(
                drone=self.drone,
                scene=self.scene if self.drone in {"twin", "plain"} else None,
                seed=self.seed,
            )
            if self.drone != "plain":
                size = (160, 90) if self.exact_masks else (320, 180)
                options = replace(options, image_size_px=size)
        return WatchedDrone(app.make_drone(options), self.parsed)

    @contextmanager
    def served(self) -> Iterator[None]:
        """Serve the loopback ANAFI, if it is the drone."""
        if self.address is None:
            yield
            return
        with served(self.address, scene=self.scene, seed=self.seed, rate_hz=_RATE_HZ):
            yield


class WatchedDrone(FaultyDrone):
    """Follows a drone, also after the end of its flight."""

    def __init__(self, drone: Drone, fault: Fault) -> None:
        super().__init__(drone, fault)
        self.events: dict[str, None] = {}  # in the order of their first time
        self.phases: set[str] = set()
        self.touched: set[str] = set()
        self.beyond_edge = False
        self.ended_s = 0.0
        self.motors_on = False
        self.height_m = 0.0
        self.on_mark: bool | None = None

    def observe(self) -> Observation:
        """Look at the truth, too."""
        if self.referee is not None:
            self._look()
        return super().observe()

    def on_tick(self, record: TickRecord) -> None:
        """Note overrides, with their causes as the report states them, and phases."""
        self.phases.add(record.phase)
        if record.override is not None:
            self.events[record.override.value] = None
        for event in record.events:
            if event.kind == EventKind.OVERRIDE:
                self.events[event.text] = None
        super().on_tick(record)

    def disconnect(self) -> None:
        """Watch the drone after the end of the program."""
        self.ended_s = self.clock.now()
        while self.phases and self.clock.now() < self.ended_s + _AFTER_S:
            self.clock.sleep_until(self.clock.now() + 0.1)
            self._look()
        super().disconnect()

    def _look(self) -> None:
        """Note the truth; without a referee, the drone's reports before the fault."""
        if self.referee is None:
            state = self._drone.observe().state
            self.motors_on = state.flying not in _MOTORS_OFF
            self.height_m = state.height_above_ground_m
            return
        truth = self.referee.truth()
        rules = JudgeConfig()
        self.touched.update(n for n in truth.contacts if not rules.is_landing_surface(n))
        self.beyond_edge |= not truth.inside_ground
        self.motors_on, self.height_m = truth.motors_on, truth.pose.z_m
        self.on_mark = truth.on_mark


def fly(case: Case, folder: Path) -> dict[str, Any]:
    """Fly a case and return its line: the case, and what happened.

    Args:
        case: what to fly.
        folder: where the report goes, and the record of a flight with a full disk.

    Raises:
        InputError: it cannot be flown.
    """
    fault, drone = case.parsed, case.make_drone()
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{fault}-{case.scene}-{case.seed}.json".replace(" ", "_")
    path.unlink(missing_ok=True)
    record = path.with_suffix(".mcap") if fault.kind is _DISK_FULL else None
    options = app.FlightOptions(
        drone=drone,
        seed=case.seed,
        exact_masks=case.exact_masks,
        record=record,
        judge=JudgeConfig(
            time_limit_s=case.time_limit_s, land_on=None if case.on_pad else LandOn.ANY
        ),
    )
    report, error, began_s = None, None, time.perf_counter()
    with case.served(), _warnings(drone.events), _unlimited_files():
        try:
            report = app.fly(case.tree, options, report=path)
        except Exception as raised:
            if isinstance(raised, InputError) and not drone.phases:
                raise  # nothing was flown: the case is wrong, not the reaction
            notes = getattr(raised, "__notes__", ())
            error = "; ".join([f"{type(raised).__name__}: {raised}", *notes])
    written = _read(path)
    result = written if report is None else _plain(report)
    facts = Facts(
        began_s=drone.began_s,
        ended_s=round(drone.ended_s, 2),
        outcome=None if result is None else result["outcome"],
        reason=None if result is None else result["reason"],
        error=error,
        events=(*drone.events, *_said_beside(result or {})),
        touched=tuple(sorted(drone.touched)),
        beyond_edge=drone.beyond_edge,
        emergency_landing=MissionPhase.EMERGENCY_LANDING in drone.phases,
        motors_on=drone.motors_on,
        on_mark=drone.on_mark if case.on_pad else None,
        height_m=round(drone.height_m, 2),
        report_whole=written is not None and written == result,
    )
    wall_s = round(time.perf_counter() - began_s, 2)
    return {"case": asdict(case), "facts": asdict(facts), "wall_s": wall_s}


def died(case: Case) -> dict[str, Any]:
    """Return the line of a flight whose process was killed, or killed itself."""
    facts = Facts(
        began_s=0.0,
        ended_s=0.0,
        outcome=None,
        reason=None,
        error="the process died",
        events=(),
        touched=(),
        beyond_edge=False,
        emergency_landing=False,
        motors_on=True,
        on_mark=None,
        height_m=0.0,
        report_whole=False,
    )
    return {"case": asdict(case), "facts": asdict(facts), "wall_s": 0.0}


@contextmanager
def _warnings(events: dict[str, None]) -> Iterator[None]:
    """Note log messages of level WARNING or above."""
    handler = logging.Handler(logging.WARNING)
    handler.emit = lambda record: events.setdefault(record.getMessage())  # type: ignore[method-assign]
    root = logging.getLogger()
    root.addHandler(handler)
    try:
        yield
    finally:
        root.removeHandler(handler)


@contextmanager
def _unlimited_files() -> Iterator[None]:
    """Undo the effects of a full disk."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def _read(path: Path) -> dict[str, Any] | None:
    try:
        read: dict[str, Any] = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return None
    return read


def _plain(report: FlightReport) -> dict[str, Any]:
    plain: dict[str, Any] = json.loads(json.dumps(report.to_json()))
    return plain


def _said_beside(report: dict[str, Any]) -> Iterator[str]:
    """Yield the texts of a report other than its reason."""
    if report.get("airborne_at_end"):
        yield "still in the air"
    for output, trouble in report.get("lost_outputs", {}).items():
        yield f"{output}: {trouble}"
