"""Assembly of a flight from mission, drone, policies and masks."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, Generic, TypeVar

import numpy as np

from perception.camera.frame_watch import FrameWatch
from uav_bt import plugins
from uav_bt.app.drone_of_flight import check_phases, make_drone, with_faults
from uav_bt.app.loading import Mission, load_mission
from uav_bt.app.options import FlightOptions, given_options
from uav_bt.app.place import Conditions, conditions_of, refuse_foreign_network
from uav_bt.app.site import check_clearances
from uav_bt.board import CAMERA, MISSION_KEYS
from uav_bt.board.blackboard import Blackboard
from uav_bt.board.context import FlightFolder, MissionContext
from uav_bt.clock import TickClock
from uav_bt.errors import DroneError, InputError, NodeFailedError
from uav_bt.lab.classes import LabClasses
from uav_bt.mission.judge import Judge
from uav_bt.mission.runner import MissionRunner, NextTree
from uav_bt.mission.screening import FrameJudge
from uav_bt.mission.tick import TickListener
from uav_bt.protocols import Drone, Imageless, LeafPolicy, Photographing, Segmenter
from uav_bt.testing.faults import find_faulty_drones
from uav_bt.tree import MissionTree, NodeRegistry
from uav_bt.types import ClassMap, Frame

DroneT = TypeVar("DroneT", bound=Drone)

_LOG: Final = logging.getLogger(__name__)
_EXACT_PX: Final = (224, 112)  # width and height of exact class maps
_STILL_S: Final = 2.0  # of a real camera; longer than video needs to repeat a whole image


@dataclass(eq=False)
class Flight(Generic[DroneT]):
    """A mission with its drone, options and policies; nothing is connected yet.

    A replay states what `held`, its own judge and runner, and a source of class maps.
    """

    mission: MissionTree
    drone: DroneT
    options: FlightOptions
    held: Conditions
    judge: Judge
    segmenter: Segmenter | None = None
    make_runner: Callable[..., MissionRunner] = MissionRunner
    outputs: FlightFolder | None = None

    def __post_init__(self) -> None:
        self._faulty = find_faulty_drones(self.drone)
        check_phases(self.mission, [one.fault for one in self._faulty])
        self._clock = TickClock(self.drone.clock)
        plugins.make_mark_finder(self.held.mark)  # refuses wrong options before the flight

    def missed_faults(self) -> list[str]:
        """Return a warning for each fault of the drone that the flight did not have."""
        missed = [one for one in self._faulty if one.missed is not None]
        return [f"the fault {one.fault} had no effect: {one.missed}" for one in missed]

    @cached_property
    def context(self) -> MissionContext:
        """Context of the mission's leaves; the drone must be connected."""
        held, drone = self.held, self.drone
        sight = drone.sight if isinstance(drone, Imageless) else None
        exact = _ExactSegmenter(drone, held.classes) if self.options.exact_masks else None
        return MissionContext(
            board=Blackboard(self._clock, MISSION_KEYS),
            clock=self._clock,
            policy=self._policy,
            seed=self.options.seed,
            inference_threads=self.options.inference_threads,
            segmenter=self.segmenter or exact or sight,
            sight=sight,
            stills=drone.stills if isinstance(drone, Photographing) else None,
            ground=held.site.ground,
            classes=held.classes,
            airframe=drone.airframe,
            mark=held.mark,
            clearances=held.site.clearances,
            take_off=held.take_off,
            mark_pose=held.mark_pose,
            area=held.area,
            outputs=self.outputs,
        )

    def _policy(self, name: str) -> LeafPolicy:
        if (given := self.options.policy_objects.get(name)) is not None:
            return given
        return plugins.make_policy(name, self.options.own_parts.policies)

    @property
    def scene_name(self) -> str | None:
        """The name of a simulated drone's scene; None on a real drone."""
        scene = self.drone.scene
        return None if scene is None else scene.name

    @contextmanager
    def connected(self) -> Iterator[None]:
        """Connect the drone and set the mission up; undo both at the end."""
        options = self.options
        given = self.segmenter is not None or isinstance(self.drone, Imageless)
        if not given and not options.exact_masks:
            refuse_foreign_network(self.mission, self.held.lab, named=options.lab is not None)
        try:
            self.drone.connect()
            self.context.board.write(CAMERA, self.drone.camera)
            self.mission.setup(self.context)
            yield
        finally:
            # The flight is over: what fails now does not change its result.
            try:
                self.mission.shutdown()
            except NodeFailedError as error:
                _LOG.warning("after the flight: %s", error)
            with suppress(DroneError):
                self.drone.disconnect()

    def runner(
        self, listeners: Sequence[TickListener], next_tree: NextTree | None = None
    ) -> MissionRunner:
        """Return the runner; between ticks `next_tree` may replace its tree."""
        config, tick_s = self.options.runner, self.drone.tick_s
        others = [one for one in listeners if one not in self._faulty]
        return self.make_runner(
            self.drone,
            self.mission,
            self.context,
            self.judge,
            limits=self.held.limits,
            config=config if tick_s is None else replace(config, tick_s=tick_s),
            listeners=[*self._faulty, *others],
            # A rehearsed drone moves in numbers only: its images rightly stay the same.
            judge_frame=None if self.options.rehearse else frame_judge(self.drone),
            next_tree=next_tree,
        )


Listeners = Callable[[Flight[Drone]], Sequence[TickListener]]
"""Makes tick listeners of a flight, once its drone is connected and its tree set up."""


def assemble(
    tree: Mission,
    options: FlightOptions | None = None,
    *,
    registry: NodeRegistry | None = None,
    **how: Any,
) -> Flight[Drone]:
    """Put a flight together from a tree and options; nothing is connected.

    Args:
        tree: Mission. A `MissionTree` flies once.
        options: Options of the flight.
        registry: Nodes that the tree may use. Default: all installed.
        how: Fields of `FlightOptions`. They replace those of `options`.

    Raises:
        InputError: Tree, policy, scene, site or drone was refused.
    """
    options = given_options(options, how)
    return join(load_mission(tree, options, registry), options)


def join(
    mission: MissionTree, options: FlightOptions, outputs: FlightFolder | None = None
) -> Flight[Drone]:
    """Return a flight of a loaded mission, with a new drone."""
    drone = with_faults(make_drone(options), options.faults)
    held = conditions_of(options, mission, drone)
    check_clearances(held.site, drone.airframe)
    judge = Judge(held.judge, held.mark, held.area)
    return Flight(mission, drone, options, held, judge, outputs=outputs)


def frame_judge(drone: Drone) -> FrameJudge:
    """Return the check of images: it explains why an image is unusable for flight."""
    return FrameWatch(still_s=_STILL_S) if drone.live else FrameWatch()


class _ExactSegmenter:
    """The twin's exact class ids as a segmenter, for evaluations."""

    def __init__(self, drone: Drone, classes: LabClasses) -> None:
        if drone.referee is None:
            raise InputError("exact masks need a simulated drone")
        self._referee = drone.referee
        self._classes = classes

    def segment(self, frame: Frame) -> ClassMap:
        """Return the exact class map of a delivered frame."""
        ids = np.ascontiguousarray(self._referee.class_ids(frame, *_EXACT_PX))
        return ClassMap(ids=ids, classes=self._classes, captured_s=frame.captured_s)
