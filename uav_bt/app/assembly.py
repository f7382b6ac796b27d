"""What a flight is put together from: options, mission, drone, policies, masks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from uav_bt import plugins
from uav_bt.app.calibrated_drone import CalibratedDrone
from uav_bt.app.rehearsed_drone import RehearsedDrone
from uav_bt.app.site import Site
from uav_bt.errors import InputError
from uav_bt.mission.arbiter import Limits
from uav_bt.mission.judge import JudgeConfig
from uav_bt.mission.runner import RunnerConfig
from uav_bt.protocols import Drone, DroneOptions, LeafPolicy, Referee, Segmenter
from uav_bt.record.config import Quality
from uav_bt.tree import MissionTree, load_tree
from uav_bt.types import ClassMap, Frame

__all__ = [
    "ExactSegmenter",
    "FlightOptions",
    "exact_segmenter",
    "limits_of",
    "load_mission",
    "make_drone",
    "make_policy",
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
    site, limits = options.site or Site(), limits_of(options)
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


def limits_of(options: FlightOptions) -> Limits:
    """Return the limits of the place, else those of the options."""
    return options.limits if options.site is None else options.site.limits


def load_mission(path: Path, options: FlightOptions) -> MissionTree:
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


def exact_segmenter(drone: Drone) -> Segmenter:
    """Return what segments exactly; raises InputError for a drone without a referee."""
    if drone.referee is None:
        raise InputError("exact masks need a simulated drone: a real one has no referee")
    return ExactSegmenter(drone.referee)
