"""How a flight is put together: the one place that joins mission, drone, policies and masks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from uav_bt import plugins
from uav_bt.app.calibrated_drone import CalibratedDrone
from uav_bt.app.rehearsed_drone import RehearsedDrone
from uav_bt.app.site import Site
from uav_bt.board import MISSION_KEYS
from uav_bt.board.blackboard import Blackboard
from uav_bt.board.context import MissionContext
from uav_bt.clock import TickClock
from uav_bt.errors import InputError
from uav_bt.mission.judge import Judge, JudgeConfig
from uav_bt.mission.runner import MissionRunner, RunnerConfig
from uav_bt.mission.safety import Limits
from uav_bt.mission.tick import TickListener
from uav_bt.protocols import Drone, DroneConfig, Referee, Segmenter
from uav_bt.record.channels import Quality
from uav_bt.tree import MissionTree, NodeRegistry, load_tree
from uav_bt.tree.shipped import resolve_tree
from uav_bt.types import ClassMap, Frame


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
    camera: Path | None = None  # a camera file in place of the drone's own intrinsics
    exact_masks: bool = False  # simulated drones: fly on the referee's masks instead of a network
    record: Path | None = None  # where the flight's record goes, an MCAP file; None keeps none
    record_quality: Quality = "lossless"  # of its images; only lossless ones replay exactly
    site: Site | None = None  # the place: heights, camera, classes, limits; from a site file
    rehearse: bool = False  # perceive and decide, but fly in numbers only
    limits: Limits = field(default_factory=Limits)  # the site's, where there is one
    runner: RunnerConfig = field(default_factory=RunnerConfig)
    judge: JudgeConfig = field(default_factory=JudgeConfig)


DroneT = TypeVar("DroneT", bound=Drone)

_CEILING_SLACK_M = 0.6  # of the drone's own ceiling above the mission's


class ExactSegmenter:
    """The twin's exact class ids as a segmenter: for evaluations, never for a mission's result.

    Args:
        referee: knows the exact class ids.
        size_px: width and height of the class maps.
    """

    def __init__(self, referee: Referee, size_px: tuple[int, int] = (224, 112)) -> None:
        self._referee = referee
        self._size_px = size_px

    def segment(self, frame: Frame) -> ClassMap:
        """Return the exact class map of a delivered frame."""
        ids = self._referee.class_ids(frame, *self._size_px)
        return ClassMap(ids=np.ascontiguousarray(ids), captured_s=frame.captured_s)


class Flight(Generic[DroneT]):
    """A mission with everything that it is flown with; nothing is connected yet.

    Args:
        mission: the loaded tree.
        drone: what flies.
        options: how.
        judge: decides when the flight has ended; default: as the options say.
        segmenter: class maps in place of the networks'; default: as the options say.
        make_runner: makes the runner; takes what `MissionRunner` does.
    """

    def __init__(
        self,
        mission: MissionTree,
        drone: DroneT,
        options: FlightOptions,
        *,
        judge: Judge | None = None,
        segmenter: Segmenter | None = None,
        make_runner: Callable[..., MissionRunner] = MissionRunner,
    ) -> None:
        self.mission = mission
        self.drone = drone
        self.options = options
        self._judge = judge or Judge(options.judge)
        self._segmenter = segmenter
        self._make_runner = make_runner
        self._clock = TickClock(drone.clock)

    @cached_property
    def context(self) -> MissionContext:
        """What the leaves are handed; the drone must be connected.

        Raises:
            InputError: exact masks are wanted of a drone without a referee.
        """
        site = self.options.site
        return MissionContext(
            board=Blackboard(self._clock, MISSION_KEYS),
            clock=self._clock,
            seed=self.options.seed,
            inference_threads=self.options.inference_threads,
            segmenter=self._segmenter or self._exact_segmenter(),
            ground=() if site is None else site.ground,
        )

    def _exact_segmenter(self) -> Segmenter | None:
        if not self.options.exact_masks:
            return None
        if self.drone.referee is None:
            raise InputError("exact masks need a simulated drone: a real one has no referee")
        return ExactSegmenter(self.drone.referee)

    @property
    def scene_name(self) -> str | None:
        """The name of the scene that a simulated drone flies in; None on a real drone."""
        scene = self.drone.scene
        return self.options.scene if scene is None else scene.name

    @contextmanager
    def connected(self) -> Iterator[None]:
        """Connect the drone and set the mission up; disconnect the drone at the end.

        Raises:
            DroneError: the drone cannot be reached.
            InputError: a leaf cannot use what it was given.
        """
        try:
            self.drone.connect()
            self.mission.setup(self.context)
            yield
        finally:
            self.drone.disconnect()

    def runner(self, listeners: Sequence[TickListener]) -> MissionRunner:
        """Return what flies the mission; the drone is connected."""
        config, tick_s = self.options.runner, self.drone.tick_s
        return self._make_runner(
            self.drone,
            self.mission,
            self.context,
            self._judge,
            limits=_limits(self.options),
            config=config if tick_s is None else replace(config, tick_s=tick_s),
            listeners=listeners,
            clock=self._clock,
        )


def assemble(tree: str | Path, options: FlightOptions | None = None) -> Flight[Drone]:
    """Put a flight together from a tree and options; nothing is connected.

    Args:
        tree: a tree file, or the name of a shipped mission.
        options: how it is flown.

    Raises:
        InputError: tree, policy, scene or drone cannot be used.
    """
    options = options or FlightOptions()
    return Flight(load_mission(tree, options), make_drone(options), options)


def load_mission(
    tree: str | Path, options: FlightOptions, registry: NodeRegistry | None = None
) -> MissionTree:
    """Load a tree with what options and site replace in it.

    Args:
        tree: a tree file, or the name of a shipped mission.
        options: policies by node, and the site.
        registry: the nodes that may occur; default: all installed.

    Raises:
        TreeError: the file was refused, or a policy is unknown.
    """
    overrides = {node: {"policy": policy} for node, policy in options.policies.items()}
    return load_tree(
        resolve_tree(tree), registry, overrides=overrides, by_id=_site_values(options.site)
    )


def _site_values(site: Site | None) -> dict[str, dict[str, str]]:
    """Return what a site replaces in a tree: attributes by node id."""
    if site is None:
        return {}
    height_m = None if site.flight_height_m is None else f"{site.flight_height_m:g}"
    classes = None if site.classes is None else str(site.classes)
    wanted = {
        "Segment": {"model": site.model, "classes": classes},
        "TakeOff": {"height_m": height_m},
    }
    return {
        node_id: {name: value for name, value in attributes.items() if value is not None}
        for node_id, attributes in wanted.items()
    }


def make_drone(options: FlightOptions) -> Drone:
    """Return an unconnected drone.

    Raises:
        UnknownNameError: no drone is registered under that name.
        InputError: the drone refuses the options.
    """
    name = options.drone.partition(":")[0]
    config: type[DroneConfig] = plugins.load(plugins.DRONES, name)
    known = {each.name for each in fields(config)}  # type: ignore[arg-type]  # a dataclass
    given = {key: value for key, value in drone_settings(options).items() if value is not None}
    for key in ("address", "scene"):
        if key in given and key not in known:
            raise InputError(f"drone '{name}' takes no {key}, got '{given[key]}'")
    drone = config(**{key: value for key, value in given.items() if key in known}).create()
    camera = options.camera or (options.site or Site()).camera
    if camera is not None:
        drone = CalibratedDrone(drone, camera)
    return RehearsedDrone(drone) if options.rehearse else drone


def drone_settings(options: FlightOptions) -> dict[str, Any]:
    """Return what options say about a drone, by the name of a field of its config class.

    None: the drone's own default holds.
    """
    site, limits = options.site or Site(), _limits(options)
    _, colon, address = options.drone.partition(":")
    return {
        "address": address if colon else None,
        "scene": options.scene,
        "seed": options.seed,
        "profile": options.profile,
        "image_size_px": options.image_size_px,
        "realtime": options.realtime,
        "http_port": site.http_port,
        "rtsp_port": site.rtsp_port,
        "speed_limit_mps": limits.speed_mps,
        "climb_limit_mps": limits.climb_mps,
        "yaw_rate_limit_radps": limits.yaw_rate_radps,
        # The drone's own ceiling counts from where it takes off, and lies above the mission's.
        "altitude_limit_m": limits.ceiling_m - site.take_off_surface_m + _CEILING_SLACK_M,
        "take_off_surface_m": site.take_off_surface_m,
        "video_latency_s": site.video_latency_s,
    }


def _limits(options: FlightOptions) -> Limits:
    return options.limits if options.site is None else options.site.limits
