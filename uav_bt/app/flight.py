"""A mission flown: from a tree file to its report."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import asdict, replace
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from uav_bt.app.assembly import (
    ExactSegmenter,
    FlightOptions,
    exact_segmenter,
    limits_of,
    load_mission,
    make_drone,
    make_policy,
)
from uav_bt.app.site import Site
from uav_bt.board import MISSION_KEYS
from uav_bt.board.blackboard import Blackboard
from uav_bt.board.context import MissionContext
from uav_bt.board.proposals import Proposals
from uav_bt.clock import TickClock
from uav_bt.errors import FileError, TreeError, UavBtError
from uav_bt.mission.flight_report import FlightLog, FlightReport, write_report
from uav_bt.mission.judge import Judge, Outcome, Verdict
from uav_bt.mission.preflight import Check, check_drone, refuse_faults
from uav_bt.mission.runner import MissionRunner, RunnerConfig, TickListener
from uav_bt.plugins import need
from uav_bt.protocols import Drone
from uav_bt.tree import MissionTree, NodeRegistry, load_tree
from uav_bt.tree.policy_check import unknown_policies
from uav_bt.tree.shipped import resolve_tree

if TYPE_CHECKING:
    from uav_bt.app.flight_record import FlightRecord

__all__ = [
    "ExactSegmenter",
    "FlightOptions",
    "check",
    "fly",
    "make_drone",
    "make_policy",
    "resolve_tree",
]


def check(tree: str | Path, registry: NodeRegistry | None = None) -> MissionTree:
    """Load a tree file and return it.

    Raises:
        TreeError: the file was refused; the error holds all findings.
    """
    return load_tree(resolve_tree(tree), registry)


@contextmanager
def _landing_on_interrupt(runner: MissionRunner) -> Iterator[None]:
    """Turn Ctrl-C and SIGTERM into a landing; a second one gets through."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def restore() -> None:
        for number, handler in previous.items():
            signal.signal(number, handler)

    def land(number: int, frame: FrameType | None) -> None:
        del frame
        restore()
        runner.request_abort(f"stopped by {signal.Signals(number).name}")

    for number in previous:
        signal.signal(number, land)
    try:
        yield
    finally:
        restore()


def fly(
    tree: str | Path,
    options: FlightOptions | None = None,
    *,
    report: Path | None = None,
    listeners: Callable[[Drone, MissionContext], Sequence[TickListener]] | None = None,
    tree_listeners: Callable[[MissionTree, MissionContext], Sequence[TickListener]] | None = None,
    told: Callable[[Check], None] | None = None,
    controls: Callable[[MissionRunner], AbstractContextManager[None]] | None = None,
) -> FlightReport:
    """Fly a mission and return its report.

    Before a real drone (its attribute `live` says so) takes off, it is looked at: battery, link,
    telemetry, video.

    Args:
        tree: a tree file, or the name of a shipped mission.
        options: how to fly it.
        report: where to write the report as JSON; it is also written when the mission fails.
        listeners: makes what follows the flight tick by tick (displays, videos, records); called
            with the connected drone.
        tree_listeners: makes what follows the tree node by node (Groot2, logs); called with the
            tree when it is set up.
        told: hears each line of the check before take-off.
        controls: what a person has at hand while the mission flies, a keyboard for instance.

    Raises:
        InputError: tree, scene, weights, policy or drone cannot be used; nothing was flown.
        DroneError: the drone cannot be reached, or is not ready to take off.
        NodeFailedError: a leaf raised; the drone was landed and the report written, as it is when
            the drone or a listener raises.
    """
    options = options or FlightOptions()
    path = resolve_tree(tree)
    mission = load_mission(path, options)
    unknown = unknown_policies(mission, path)
    if unknown:
        raise TreeError(path, [str(finding) for finding in unknown])
    if report is not None and not report.parent.is_dir():
        raise FileError(report, f"folder {report.parent} does not exist; create it first")
    drone = make_drone(options)
    with ExitStack() as stack:
        record = (
            None
            if options.record is None
            else stack.enter_context(_record(options.record, options))
        )
        stack.callback(drone.disconnect)
        drone.connect()
        flown = _fly_connected(
            mission,
            path,
            drone,
            options,
            report_path=report,
            record=record,
            listeners=listeners,
            tree_listeners=tree_listeners,
            told=told,
            controls=controls,
        )
        if record is not None:
            record.conclude(flown)
        return flown


def _record(file: Path, options: FlightOptions) -> FlightRecord:
    if not file.parent.is_dir():
        raise FileError(file, f"folder {file.parent} does not exist; create it first")
    need("record", "mcap", "foxglove", what="a flight record")
    from uav_bt.app.flight_record import FlightRecord  # noqa: PLC0415 - most flights need no such extra

    told = asdict(options)
    del told["record"]
    return FlightRecord(file, told, quality=options.record_quality, realtime=options.realtime)


def _fly_connected(
    mission: MissionTree,
    path: Path,
    drone: Drone,
    options: FlightOptions,
    *,
    report_path: Path | None,
    record: FlightRecord | None,
    listeners: Callable[[Drone, MissionContext], Sequence[TickListener]] | None,
    tree_listeners: Callable[[MissionTree, MissionContext], Sequence[TickListener]] | None,
    told: Callable[[Check], None] | None,
    controls: Callable[[MissionRunner], AbstractContextManager[None]] | None,
) -> FlightReport:
    clock = TickClock(drone.clock)
    context = MissionContext(
        board=Blackboard(clock, MISSION_KEYS),
        clock=clock,
        proposals=Proposals(),
        policy=make_policy,
        seed=options.seed,
        inference_threads=options.inference_threads,
        segmenter=exact_segmenter(drone) if options.exact_masks else None,
        ground=() if options.site is None else options.site.ground,
    )
    mission.setup(context)
    if getattr(drone, "live", False) and not options.rehearse:
        _check_before_take_off(drone, options.site or Site(), told)
    log = FlightLog()
    followers = [
        log,
        *(() if record is None else (record.begin(mission, path, drone, context),)),
        *(listeners(drone, context) if listeners else ()),
        *(tree_listeners(mission, context) if tree_listeners else ()),
    ]
    runner = MissionRunner(
        drone,
        mission,
        context,
        Judge(options.judge),
        limits=limits_of(options),
        config=_paced(options.runner, drone),
        listeners=followers,
        clock=clock,
    )

    def finish(verdict: Verdict) -> FlightReport:
        result = log.report(
            verdict,
            scene=options.scene or _scene_name(drone),
            seed=options.seed,
            tree=path.name,
            policies=_policies(mission),
            drone=options.drone,
            profile=options.profile if drone.referee is not None else None,
            stage_times_s=context.stage_times_s,
            slow_leaves_s=runner.slow_leaves_s,
        )
        if report_path is not None:
            write_report(result, report_path)
        return result

    try:
        with _landing_on_interrupt(runner), controls(runner) if controls else nullcontext():
            verdict = runner.run()
    except Exception as error:
        ours = isinstance(error, UavBtError)
        reason = str(error) if ours else f"{type(error).__name__}: {error}"
        finish(Verdict(outcome=Outcome.ERROR, reason=reason))
        raise
    return finish(verdict)


def _check_before_take_off(drone: Drone, site: Site, told: Callable[[Check], None] | None) -> None:
    checks = check_drone(drone, site.preflight)
    for check_ in checks:
        if told is not None:
            told(check_)
    refuse_faults(checks)


def _paced(config: RunnerConfig, drone: Drone) -> RunnerConfig:
    """Return the config at the pace of a drone that ticks with its frames."""
    tick_s: float | None = getattr(drone, "tick_s", None)
    return config if tick_s is None else replace(config, tick_s=tick_s)


def _scene_name(drone: Drone) -> str | None:
    scene = getattr(drone, "scene", None)  # simulated drones have one, by default too
    return str(scene.name) if scene is not None else None


def _policies(mission: MissionTree) -> dict[str, str]:
    return {
        leaf.path: str(leaf.port_value("policy"))
        for leaf in mission.leaves()
        if any(port.name == "policy" for port in leaf.ports)
    }
