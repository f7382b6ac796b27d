"""Inject faults into flights and judge the reactions.

    python -m benchmarks.faults --out runs/faults                       # all kinds, all phases
    python -m benchmarks.faults --kind video-lost~3 late=0.7 --phase explore land

docs/faults.md says which reactions are right. Exit code 0: all are; 1: some are not; 2: refused.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

from pebble import ProcessExpired, ProcessPool

from benchmarks.fault_reactions import EXPECTED, Facts, problems
from uav_bt import app
from uav_bt.errors import InputError
from uav_bt.mission.judge import LANDING_SURFACES, JudgeConfig
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import Drone
from uav_bt.testing.fault_kinds import FAULTS, FaultKind
from uav_bt.testing.faults import Fault, FaultyDrone
from uav_bt.types import MissionPhase, Observation
from uav_bt.types.place import LandOn

PHASES: Final = ("take-off", "explore", "approach", "center", "land")
_AFTER_S: Final = 3.0  # the drone is watched for this time after the program's end


def _fill_disk() -> None:
    """Let no file of this process grow; writing fails as it does on a full disk."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))


_DISK_FULL: Final = FaultKind(
    name="disk-full", what="nothing more can be written", follow=_fill_disk
)
KINDS: Final[Mapping[str, FaultKind]] = {**FAULTS, _DISK_FULL.name: _DISK_FULL}
# Only networks notice these; exact masks stay as they are.
IN_IMAGE: Final = {"black", "white", "noise", "covered", "half-size", "empty-image"}


class WatchedDrone(FaultyDrone):
    """Follows a drone, also after the end of its flight."""

    def __init__(self, drone: Drone, fault: Fault) -> None:
        super().__init__(drone, fault)
        self.phases: set[str] = set()
        self.touched: set[str] = set()
        self.beyond_edge = False
        self.motors_on = False
        self.height_m = 0.0
        self.on_mark: bool | None = None

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
        if self.referee is None:
            return
        truth = self.referee.truth()
        self.touched.update({*truth.contacts} - LANDING_SURFACES)
        self.beyond_edge |= not truth.inside_ground
        self.motors_on, self.height_m = truth.motors_on, truth.pose.z_m
        self.on_mark = truth.on_mark


def watched_drone(fault: Fault, *, drone: str, scene: str, seed: int) -> WatchedDrone:
    """Return an unconnected drone with a fault; its images are small where masks are exact."""
    options = app.FlightOptions(drone=drone, scene=scene, seed=seed)
    if drone != "plain":
        size_px = (320, 180) if fault.kind.name in IN_IMAGE else (160, 90)
        options = replace(options, image_size_px=size_px)
    return WatchedDrone(app.make_drone(options), fault)


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
    fault = Fault.parse(text, KINDS)
    watched = watched_drone(fault, drone=drone, scene=scene, seed=seed)
    path = folder / f"{fault}-{scene}-{seed}.json".replace(" ", "_")
    path.unlink(missing_ok=True)
    options = app.FlightOptions(
        drone=watched,
        seed=seed,
        exact_masks=drone != "plain" and fault.kind.name not in IN_IMAGE,
        ports=ports or {},
        record=path.with_suffix(".mcap") if fault.kind is _DISK_FULL else None,
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
    return Facts(
        began_s=watched.began_s,
        outcome=result.get("outcome"),
        reason=result.get("reason"),
        error=error,
        events=(*overrides, *result.get("warnings", ()), *lost, *flies),
        touched=tuple(sorted(watched.touched)),
        beyond_edge=watched.beyond_edge,
        emergency_landing=MissionPhase.EMERGENCY_LANDING in watched.phases,
        motors_on=watched.motors_on,
        on_mark=watched.on_mark if on_pad else None,
        height_m=round(watched.height_m, 2),
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
        watched_drone(faults[0], **where)  # refused here, not in another process
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
