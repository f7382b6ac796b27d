"""Everything put together: the Python API behind the command line.

Example:
    >>> from uav_bt import app
    >>> report = app.fly("land_only", app.FlightOptions(scene="train-a", seed=7))
    >>> report.outcome
    'success'
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

import numpy as np

from uav_bt import plugins
from uav_bt.board import MISSION_KEYS
from uav_bt.calibrated_drone import CalibratedDrone
from uav_bt.checking import unknown_policies
from uav_bt.errors import FileError, InputError, TreeError, UavBtError
from uav_bt.mission.arbiter import Limits, Proposals
from uav_bt.mission.blackboard import Blackboard
from uav_bt.mission.context import MissionContext
from uav_bt.mission.judge import Judge, JudgeConfig, Outcome, Verdict
from uav_bt.mission.runner import MissionRunner, RunnerConfig, TickListener
from uav_bt.preflight import Check, check_drone, refuse_faults
from uav_bt.protocols import Drone, DroneOptions, LeafPolicy, Referee, Segmenter
from uav_bt.record.channels import need_extra
from uav_bt.record.config import Quality
from uav_bt.rehearsal import RehearsedDrone
from uav_bt.report.flight_report import FlightLog, FlightReport, write_report
from uav_bt.site_file import Site
from uav_bt.tree import MissionTree, NodeRegistry, load_tree
from uav_bt.tree_files import resolve_tree
from uav_bt.types import ClassMap, Frame

if TYPE_CHECKING:
    from uav_bt.recording import FlightRecord

__all__ = [
    "ExactSegmenter",
    "FlightOptions",
    "check",
    "fly",
    "make_drone",
    "make_policy",
    "resolve_tree",
]


@dataclass(frozen=True, kw_only=True)
class FlightOptions:
    """How a mission is flown."""

    scene: str | None = None  # a scene's name or file; the twin's default when None
    seed: int = 0  # of everything random
    drone: str = "twin"  # a registered drone, NAME or NAME:ADDRESS
    profile: str = "lab"  # how imperfect the twin is
    policies: Mapping[str, str] = field(default_factory=dict)  # node's name or path -> policy
    image_size_px: tuple[int, int] = (640, 360)  # width, height
    realtime: bool = False
    inference_threads: int = 1  # one, so that a flight does not depend on the load
    camera: Path | None = None  # a camera file in place of the intrinsics the drone tells itself
    exact_masks: bool = False  # simulated drones: fly on the referee's masks instead of a network
    record: Path | None = None  # where the flight's record goes, an MCAP file; None keeps none
    record_quality: Quality = "lossless"  # of its pictures; only lossless ones replay exactly
    site: Site | None = None  # the place: heights, camera, classes, limits; from a site file
    rehearse: bool = False  # watch and think, but fly in numbers only
    limits: Limits = field(default_factory=Limits)  # the site's, where there is one
    runner: RunnerConfig = field(default_factory=RunnerConfig)
    judge: JudgeConfig = field(default_factory=JudgeConfig)


_CEILING_SLACK_M = 0.6  # of the drone's own ceiling above the mission's


class ExactSegmenter:
    """The twin's exact class ids as a segmenter: for evaluations, never for a mission's result."""

    def __init__(self, referee: Referee, size_px: tuple[int, int] = (224, 112)) -> None:
        self._referee = referee
        self._size_px = size_px

    def segment(self, frame: Frame) -> ClassMap:
        """Return the exact class map of a delivered frame."""
        ids = self._referee.class_ids(frame, *self._size_px)
        return ClassMap(ids=np.ascontiguousarray(ids), captured_s=frame.captured_s)


def make_policy(name: str) -> LeafPolicy:
    """Return a leaf policy by its registered name.

    Args:
        name: NAME, or NAME:ARGUMENT for one that has a `from_text`: `student:FILE.onnx`.

    Raises:
        UnknownNameError: nobody registered it.
        InputError: it takes no argument, or refuses this one.
    """
    registered, colon, argument = name.partition(":")
    factory = plugins.load(plugins.POLICIES, registered)
    if colon and not hasattr(factory, "from_text"):
        raise InputError(f"policy '{registered}' takes no argument, got '{name}'")
    policy = factory.from_text(argument) if colon else factory()
    if not isinstance(policy, LeafPolicy):
        raise InputError(f"policy '{name}' has no `decide`: {policy!r}")
    return policy


def make_drone(options: FlightOptions) -> Drone:
    """Return an unconnected drone.

    Raises:
        UnknownNameError: nobody registered the drone.
        InputError: the drone refuses the options.
    """
    name, colon, address = options.drone.partition(":")
    factory = plugins.load(plugins.DRONES, name)
    site, limits = options.site or Site(), _limits(options)
    drone: Drone = factory(
        DroneOptions(
            address=address if colon else None,
            scene=options.scene,
            seed=options.seed,
            profile=options.profile,
            image_size_px=options.image_size_px,
            realtime=options.realtime,
            http_port=site.http_port,
            rtsp_port=site.rtsp_port,
            speed_limit_mps=limits.speed_mps,
            climb_limit_mps=limits.climb_mps,
            yaw_rate_limit_radps=limits.yaw_rate_radps,
            # The drone's own ceiling counts from where it takes off, and lies above the mission's.
            altitude_limit_m=limits.ceiling_m - site.take_off_surface_m + _CEILING_SLACK_M,
            take_off_surface_m=site.take_off_surface_m,
            video_latency_s=site.video_latency_s,
        )
    )
    camera = options.camera or site.camera
    if camera is not None:
        drone = CalibratedDrone(drone, camera)
    return RehearsedDrone(drone) if options.rehearse else drone


def _limits(options: FlightOptions) -> Limits:
    return options.limits if options.site is None else options.site.limits


def _load_mission(path: Path, options: FlightOptions) -> MissionTree:
    """Load a tree with what options and site replace in it."""
    overrides = {node: {"policy": policy} for node, policy in options.policies.items()}
    mission = load_tree(path, overrides=overrides)
    replaced = {} if options.site is None else _site_overrides(mission, options.site)
    if not replaced:
        return mission
    for node, attributes in overrides.items():
        replaced[node] = {**replaced.get(node, {}), **attributes}
    return load_tree(path, overrides=replaced)


def _site_overrides(mission: MissionTree, site: Site) -> dict[str, dict[str, str]]:
    """Return attributes by node's path."""
    network = {"model": site.model, "classes": None if site.classes is None else str(site.classes)}
    height_m = None if site.flight_height_m is None else f"{site.flight_height_m:g}"
    asked = {"Segment": network, "TakeOff": {"height_m": height_m}}
    found: dict[str, dict[str, str]] = {}
    for leaf in mission.leaves():
        wanted = asked.get(leaf.node_id, {})
        attributes = {name: value for name, value in wanted.items() if value is not None}
        if attributes:
            found[leaf.path] = attributes
    return found


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
    mission = _load_mission(path, options)
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
    need_extra()
    from uav_bt.recording import FlightRecord  # noqa: PLC0415 - most flights need no such extra

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
    context = MissionContext(
        board=Blackboard(drone.clock, MISSION_KEYS),
        clock=drone.clock,
        proposals=Proposals(),
        policy=make_policy,
        seed=options.seed,
        inference_threads=options.inference_threads,
        segmenter=_exact_segmenter(drone) if options.exact_masks else None,
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
        limits=_limits(options),
        config=_paced(options.runner, drone),
        listeners=followers,
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


def _exact_segmenter(drone: Drone) -> Segmenter:
    if drone.referee is None:
        raise InputError("exact masks need a simulated drone: a real one has no referee")
    return ExactSegmenter(drone.referee)


def _policies(mission: MissionTree) -> dict[str, str]:
    return {
        leaf.path: str(leaf.port_value("policy"))
        for leaf in mission.leaves()
        if any(port.name == "policy" for port in leaf.ports)
    }
