"""Inject faults into flights and judge the reactions by one table of right ones.

    python -m benchmarks.faults --out runs/faults                       # all kinds, all phases
    python -m benchmarks.faults --kind video-lost~3 late=0.7 --phase explore land

ARCHITECTURE.md says which reactions are right. Exit code 0: all are; 1: some are not; 2: refused.
"""

from __future__ import annotations

import argparse
import json
import re
import resource
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from textwrap import shorten
from typing import Any, Final

from pebble import ProcessExpired, ProcessPool

from uav_bt import app
from uav_bt.errors import InputError
from uav_bt.mission.judge import LANDING_SURFACES, JudgeConfig, Outcome
from uav_bt.mission.tick import TickRecord
from uav_bt.testing.fault_kinds import FAULTS, FaultKind
from uav_bt.testing.faults import Fault, FaultyDrone
from uav_bt.types import MissionPhase, Observation, Truth
from uav_bt.types.place import LandOn

PHASES: Final = ("take-off", "explore", "approach", "center", "land")
_AFTER_S: Final = 3.0  # the drone is watched for this time after the program's end


@dataclass(frozen=True, kw_only=True)
class Expected:
    """Requirements on the reaction to one kind of fault."""

    named: str  # a regular expression of its names in reasons and warnings, from a word's begin
    bearable: bool = False  # a mission that ends on the mark all the same is right
    may_fly: bool = False  # no command can land it: it may hover at the end
    may_fall: bool = False  # its motors stop anywhere: it may touch what stands there
    reported: bool = True  # False: no report can be written


@dataclass(frozen=True, kw_only=True)
class Facts:
    """Outcome of one flight; unknown values are None."""

    began_s: float | None  # when the fault had its first effect, mission time
    outcome: str | None = None  # of the report
    reason: str | None = None
    error: str | None = None  # what flying raised
    events: tuple[str, ...] = ()  # overrides, logged warnings, what else the report says
    touched: tuple[str, ...] = ()  # but for the landing surfaces
    beyond_edge: bool = False
    emergency_landing: bool = False  # whether that phase was reached
    motors_on: bool = False  # 3 s after the end
    on_mark: bool | None = None  # None also where the mission need not end there
    height_m: float = 0.0  # above the ground, at the end
    report_whole: bool = False


_IMAGE: Final = r"image|frame|video|camera|blind|dark|frozen|stands still|bright"
_SHAPE: Final = r"(image|frame).*(size|shape|empty|\d+x\d+)"
_TELEMETRY: Final = r"telemetry|link|nothing (was )?heard"

_EXPECTED: Final = (
    ("frozen black white covered video-lost no-frame", Expected(named=_IMAGE)),
    ("noise late slow", Expected(named=_IMAGE, bearable=True)),
    ("half-size empty-image", Expected(named=_SHAPE)),
    ("no-telemetry", Expected(named=_TELEMETRY)),
    ("link-lost", Expected(named=_TELEMETRY, may_fly=True)),
    ("height-nan height-absurd", Expected(named="height|altitude")),
    ("height-bias", Expected(named="height|altitude", bearable=True)),
    ("attitude-nan attitude-absurd", Expected(named="attitude|heading|yaw|roll")),
    ("yaw-jump yaw-drift yaw-ignored", Expected(named="heading|yaw|turn", bearable=True)),
    ("velocity-nan velocity-absurd", Expected(named="velocity|speed|m/s")),
    ("velocity-bias", Expected(named="velocity|speed|odometry", bearable=True)),
    ("position-jump", Expected(named="velocity|speed|position|odometry", bearable=True)),
    ("time-jump", Expected(named="time|clock|stamp|future|nothing heard", bearable=True)),
    ("gimbal-nan gimbal-absurd", Expected(named="gimbal|camera")),
    ("gimbal-stuck", Expected(named="gimbal|camera", bearable=True)),
    ("battery-nan battery-low", Expected(named="battery")),
    ("battery-drains", Expected(named="battery", bearable=True)),  # it may land before
    ("never-done", Expected(named="movement|obey|not done", bearable=True)),
    ("interrupted", Expected(named="movement|interrupted", bearable=True)),
    ("no-take-off", Expected(named="take.?off")),
    ("no-landing", Expected(named="still (flies|in the air)|not land|landing", may_fly=True)),
    ("deaf", Expected(named="still (flies|in the air)|not land|obey|command", may_fly=True)),
    ("motors-cut", Expected(named="motors|emergency", may_fall=True)),
    ("emergency-state", Expected(named="motors|emergency")),
    ("landed-state", Expected(named="has landed.*motors|still (flies|in the air)|not take off")),
    ("pilot", Expected(named="pilot|manual", may_fly=True)),
    ("wind drift", Expected(named="wind|drift|pushed", bearable=True)),
    ("observe-raises", Expected(named="fell over")),
    ("send-raises", Expected(named="fell over", may_fly=True)),
    ("listener-raises", Expected(named="fell over", bearable=True)),
    ("disk-full", Expected(named=r"written|space|File too large", reported=False)),
)
EXPECTED: Final = {kind: expected for kinds, expected in _EXPECTED for kind in kinds.split()}


def problems(expected: Expected, phase: str, facts: Facts) -> tuple[str, ...]:
    """Return the errors of a reaction to a fault that began in a phase; none when it is right."""
    success = facts.outcome == Outcome.SUCCESS.value
    text = "\n".join([*facts.events, facts.error or "", "" if success else facts.reason or ""])
    words = re.sub(r"\S*/\S*", "", text)  # paths of nodes and files name no fault
    named = re.search(rf"\b(?:{expected.named})", words, re.IGNORECASE) is not None
    # The mission may end as without the fault.
    bearable = expected.bearable or (phase == MissionPhase.LAND and not expected.may_fall)
    landed = not facts.motors_on and facts.on_mark is not False
    flown_through = bearable and landed and success and not facts.emergency_landing
    brief = shorten(f"{facts.outcome}: {facts.reason}", 100)
    wrong = {
        f"touched {', '.join(facts.touched)}": bool(facts.touched) and not expected.may_fall,
        "flew beyond the ground's edge": facts.beyond_edge,
        f"left flying at {facts.height_m:.1f} m": facts.motors_on and not expected.may_fly,
        "a success, in the air": success and facts.motors_on,
        "a success, by an emergency landing": success and facts.emergency_landing,
        "no whole report": expected.reported and not facts.report_whole,
        f"not named: {brief}": not (named or flown_through),
    }
    return tuple(text for text, holds in wrong.items() if holds)


def _fill_disk() -> None:
    """Let no file of this process grow; writing fails as it does on a full disk."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))


_DISK_FULL: Final = FaultKind(
    name="disk-full", what="nothing more can be written", follow=_fill_disk
)
KINDS: Final = {**FAULTS, _DISK_FULL.name: _DISK_FULL}
# Only networks notice these; exact masks stay as they are.
IN_IMAGE: Final = {"black", "white", "noise", "covered", "half-size", "empty-image"}


class WatchedDrone(FaultyDrone):
    """Follows a drone, also after the end of its flight."""

    def __init__(self, text: str, drone: str, scene: str, seed: int) -> None:
        fault = Fault.parse(text, KINDS)
        options = app.FlightOptions(drone=drone, scene=scene, seed=seed)
        if drone != "plain":  # images are small where masks are exact
            size_px = (320, 180) if fault.kind.name in IN_IMAGE else (160, 90)
            options = replace(options, image_size_px=size_px)
        super().__init__(app.make_drone(options), fault)
        self.phases, self.touched = set[str](), set[str]()
        self.beyond_edge = False
        self.truth: Truth | None = None

    def observe(self) -> Observation:
        """Look at the truth, too."""
        self._look()
        return super().observe()

    def on_tick(self, record: TickRecord) -> None:
        """Note the phase."""
        self.phases.add(record.phase)
        super().on_tick(record)

    def disconnect(self) -> None:
        """Watch the drone after the end of the program."""
        ended_s = self.clock.now()
        while self.phases and self.clock.now() < ended_s + _AFTER_S:
            self.clock.sleep_until(self.clock.now() + 0.1)
            self._look()
        super().disconnect()

    def _look(self) -> None:
        if self.referee is not None:
            self.truth = self.referee.truth()
            self.touched.update({*self.truth.contacts} - LANDING_SURFACES)
            self.beyond_edge |= not self.truth.inside_ground


def fly(
    text: str,
    tree: str,
    folder: Path,
    *,
    drone: str = "twin",
    scene: str = "train-a",
    seed: int = 1,
    ports: dict[str, str] | None = None,
    time_limit_s: float = 120.0,
    on_pad: bool = True,
) -> Facts:
    """Fly with a fault, its report in a folder, and return what happened."""
    watched = WatchedDrone(text, drone, scene, seed)
    kind = watched.fault.kind
    path = folder / f"{watched.fault}-{scene}-{seed}.json".replace(" ", "_")
    path.unlink(missing_ok=True)
    options = app.FlightOptions(
        drone=watched,
        seed=seed,
        exact_masks=drone != "plain" and kind.name not in IN_IMAGE,
        ports=ports or {},
        record=path.with_suffix(".mcap") if kind is _DISK_FULL else None,
        judge=JudgeConfig(time_limit_s=time_limit_s, land_on=None if on_pad else LandOn.ANY),
    )
    result: dict[str, Any] | None = None
    error, limits = None, resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        result = json.loads(json.dumps(app.fly(tree, options, report=path).to_json()))
    except Exception as raised:
        if isinstance(raised, InputError) and not watched.phases:
            raise  # nothing was flown: the input is wrong, not the reaction
        notes = getattr(raised, "__notes__", ())
        error = "; ".join([f"{type(raised).__name__}: {raised}", *notes])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    try:
        written = json.loads(path.read_bytes())
    except (OSError, ValueError):
        written = None
    whole = written is not None and result in (None, written)
    result = result or written or {}
    events = ((each["kind"], each["text"]) for each in result.get("events", ()))
    overrides = (f"{kind}: {what}" for kind, what in events if kind in {"override", "pilot"})
    lost = (f"{output}: {why}" for output, why in result.get("lost_outputs", {}).items())
    flies = ("still in the air",) if result.get("airborne_at_end") else ()
    truth = watched.truth
    return Facts(
        began_s=watched.began_s,
        outcome=result.get("outcome"),
        reason=result.get("reason"),
        error=error,
        events=(*overrides, *result.get("warnings", ()), *lost, *flies),
        touched=tuple(sorted(watched.touched)),
        beyond_edge=watched.beyond_edge,
        emergency_landing=MissionPhase.EMERGENCY_LANDING in watched.phases,
        motors_on=truth is not None and truth.motors_on,
        on_mark=truth.on_mark if truth is not None and on_pad else None,
        height_m=0.0 if truth is None else round(truth.pose.z_m, 2),
        report_whole=whole,
    )


def reaction(text: str, facts: Facts) -> str:
    """Return the mistakes of the reaction to a fault, or that it has none."""
    if facts.began_s is None:
        return "not reached"
    fault = Fault.parse(text, KINDS)
    return "; ".join(problems(EXPECTED[fault.kind.name], fault.phase, facts)) or "right"


def fly_each(flights: Iterable[Callable[[], Facts]], workers: int) -> Iterator[Facts]:
    """Fly in processes of their own, so that one that dies ends only its flight."""
    pool = ProcessPool(max_workers=workers, context=get_context("spawn"))
    try:
        for flight in [pool.schedule(flight) for flight in flights]:
            try:
                yield flight.result()
            except ProcessExpired:
                yield Facts(began_s=0.0, error="the process died", motors_on=True)
    finally:
        pool.stop()
        pool.join()


def faults_of(kinds: Sequence[str], phases: Sequence[str]) -> list[Fault]:
    """Return faults of kinds such as `late=0.7~3`; they begin a second after a phase's begin."""
    found = {}
    for kind, phase in product(kinds, phases):
        name, wave, duration = kind.partition("~")
        place = phase if "+" in phase else f"{phase}+1"
        if name == "no-take-off":  # it can only be refused from the start on
            place = "start"
        fault = Fault.parse(f"{name}@{place}{wave}{duration}", KINDS)
        found[str(fault)] = fault
    return list(found.values())


def main(arguments: Sequence[str] | None = None) -> int:
    """Fly, print the reactions, and return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--kind", nargs="+", default=list(KINDS), metavar="KIND[=LEVEL][~SECONDS]")
    parser.add_argument("--phase", nargs="+", default=PHASES, metavar="PHASE[+SECONDS]")
    parser.add_argument("--tree", default="explore_and_land_segmentation")
    parser.add_argument("--set", nargs="*", default=["ExploreFor.duration_ms=20000"])
    parser.add_argument("--scene", default="train-a")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--drone", choices=("twin", "plain"), default="twin")
    parser.add_argument("--workers", type=int, default=1, help="flights at once")
    parser.add_argument("--out", type=Path, default=Path("runs/faults"), help="for the reports")
    given = parser.parse_args(arguments)
    where = {"drone": given.drone, "scene": given.scene, "seed": given.seed}
    ports = dict(each.split("=", 1) for each in given.set)
    right = 0
    try:
        faults = faults_of(given.kind, given.phase)
        app.check(given.tree)
        WatchedDrone(str(faults[0]), **where)  # refused here, not in another process
        given.out.mkdir(parents=True, exist_ok=True)
        one = partial(fly, tree=given.tree, folder=given.out, ports=ports, **where)
        flights = fly_each([partial(one, str(fault)) for fault in faults], given.workers)
        for fault, facts in zip(faults, flights, strict=True):
            judged = reaction(str(fault), facts)
            right += judged == "right"
            end = facts.error or f"{facts.outcome}: {facts.reason}"
            print(f"{fault!s:32s}{judged}  [{end}]", flush=True)
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    print(f"{right} of {len(faults)} reactions right")
    return 0 if right == len(faults) else 1


if __name__ == "__main__":
    sys.exit(main())
