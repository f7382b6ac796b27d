"""The mission's map against the truth: its pose in the world, its drift, its objects."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.paper_lab import CLASSES
from tests.worlds import values
from uav_bt.mission.flight_log import FlightLog
from uav_bt.mission.flight_report import FlightReport
from uav_bt.mission.map_check import MapAlignment, MapCheck
from uav_bt.mission.tick import TickRecord
from uav_bt.tree import Status
from uav_bt.types import (
    Attitude,
    Command,
    DroneState,
    FlyingState,
    Hover,
    Observation,
    Pose,
    Pose2D,
    TakeOff,
)
from uav_bt.types.ground import Footprint, Ground, Standing
from uav_bt.types.site_map import MapObject, SiteMap

BOX_1, BOX_2 = 4, 5
START = Pose(x_m=-1.0, y_m=0.5, z_m=0.0, yaw_rad=math.radians(30))
REPORTED_RAD = math.radians(20)  # clockwise: the map's x axis is at 50 degrees in the world


def tick(
    time_s: float,
    pose: Pose = START,
    *,
    reported_rad: float = REPORTED_RAD,
    taking_off: bool = False,
    referee: bool = True,
) -> TickRecord:
    truth = values.truth(pose, time_s, clearance_m=math.inf)
    state = DroneState(
        captured_s=time_s, flying=FlyingState.FLYING, attitude=Attitude(yaw_rad=reported_rad)
    )
    return TickRecord(
        index=round(10 * time_s),
        time_s=time_s,
        observation=Observation(frame=None, state=state),
        tree_status=Status.RUNNING,
        phase="",
        active=(),
        command=Command(movement=TakeOff() if taking_off else Hover()),
        proposed_by=None,
        override=None,
        compute_s=0.001,
        truth=truth if referee else None,
    )


def site_map(
    x_m: float = 0.0, y_m: float = 0.0, *objects: tuple[int, float, float], restarts: int = 0
) -> SiteMap:
    none = np.zeros((2, 2), dtype=np.bool_)
    return SiteMap(
        classes=CLASSES,
        pose=Pose2D(x_m=x_m, y_m=y_m, yaw_rad=REPORTED_RAD),
        corner_m=(0.0, 0.0),
        cell_m=0.1,
        seen_s=np.full((2, 2), -np.inf),
        free=none,
        outside=none,
        passed=none,
        obstacles_m=np.empty((0, 2)),
        edges_m=np.empty((0, 2)),
        captured_s=0.0,
        objects=tuple(
            MapObject(class_id=class_id, x_m=x, y_m=y, size_m=0.4, std_m=0.1, seen_s=0.0)
            for class_id, x, y in objects
        ),
        restarts=restarts,
    )


def in_map(x_m: float, y_m: float) -> tuple[float, float]:
    """Return a world point in the map's frame, computed independently; y is to the right."""
    along_rad = math.radians(50)
    dx, dy = x_m - START.x_m, y_m - START.y_m
    ahead = dx * math.cos(along_rad) + dy * math.sin(along_rad)
    right = dx * math.sin(along_rad) - dy * math.cos(along_rad)
    return ahead, right


def test_a_map_is_mirrored_turned_and_moved_into_the_world() -> None:
    alignment = MapAlignment()
    alignment.add(0.0, START, REPORTED_RAD, None)
    assert alignment.placement is None
    alignment.add(0.1, START, REPORTED_RAD, site_map())
    placement = alignment.placement
    assert placement is not None
    corner = np.array([in_map(2.0, -1.5), in_map(-1.0, 0.5)])
    assert placement.to_world(corner) == pytest.approx(np.array([[2.0, -1.5], [-1.0, 0.5]]))
    pose = placement.pose_to_world(site_map().pose)
    assert (pose.x_m, pose.y_m, pose.yaw_rad) == pytest.approx((-1.0, 0.5, math.radians(30)))


def test_noise_of_the_reported_yaw_does_not_turn_the_map() -> None:
    alignment = MapAlignment()
    for index in range(11):
        noise_rad = 0.05 if index % 2 else -0.05
        alignment.add(index / 10, START, REPORTED_RAD + noise_rad, site_map())
    alignment.add(5.0, START, REPORTED_RAD + 1.0, site_map())  # it drifts in flight
    placement = alignment.placement
    assert placement is not None
    assert placement.frame.yaw_rad == pytest.approx(math.radians(50), abs=0.01)


def test_a_map_that_begins_in_flight_is_aligned_where_it_began() -> None:
    alignment = MapAlignment()
    alignment.add(0.0, START, REPORTED_RAD, None)
    there = Pose(x_m=1.0, y_m=1.0, z_m=1.5, yaw_rad=START.yaw_rad)
    alignment.add(9.0, there, REPORTED_RAD, site_map(0.2, 0.0))
    placement = alignment.placement
    assert placement is not None
    pose = placement.pose_to_world(site_map(0.2, 0.0).pose)
    assert (pose.x_m, pose.y_m) == pytest.approx((1.0, 1.0))


class Flight:
    """A flight's log, with a map that the test sets."""

    def __init__(self, *standing: Standing) -> None:
        self.map: SiteMap | None = None
        ground = Ground(size_m=(5.0, 4.0), standing=standing)
        self.log = FlightLog(map_check=MapCheck(ground, lambda: self.map))
        self.log.on_tick(tick(0.0))

    def at(self, time_s: float, pose: Pose = START, **told: bool) -> None:
        self.log.on_tick(tick(time_s, pose, **told))

    def report(self) -> FlightReport:
        return values.report(self.log)


def box(class_id: int | None, x_m: float, y_m: float) -> Standing:
    footprint = Footprint(x_m=x_m, y_m=y_m, half_x_m=0.2, half_y_m=0.2)
    return Standing(footprint=footprint, height_m=1.0, class_id=class_id)


def test_objects_are_found_by_class_and_place() -> None:
    flight = Flight(box(BOX_1, 1.0, 1.0), box(BOX_2, -1.0, -1.0), box(None, 0.0, 0.0))
    flight.map = site_map(
        0.0,
        0.0,
        (BOX_1, *in_map(1.3, 1.0)),
        (BOX_1, *in_map(1.0, 1.1)),  # of two candidates the nearer counts
        (BOX_2, *in_map(-1.0, -0.4)),  # more than 0.5 m away
        (BOX_1, *in_map(-1.0, -1.0)),  # of a different class
    )
    flight.at(0.1)
    report = flight.report()
    assert (report.objects_found, report.objects_total, report.false_objects) == (1, 2, 3)
    assert report.object_errors_m == pytest.approx([0.1])


def test_the_drift_is_measured_after_the_take_off_and_at_the_end() -> None:
    flight = Flight()
    flight.map = site_map()
    flight.at(1.0, taking_off=True)
    for time_s, off_m in ((90.9, 0.1), (91.0, 0.2), (120.0, 0.3)):
        flight.map = site_map(*in_map(0.5, off_m))
        flight.at(time_s, Pose(x_m=0.5, y_m=0.0, z_m=1.5, yaw_rad=0.0))
    report = flight.report()
    assert report.map_drift_90s_m == pytest.approx(0.2)
    assert report.map_drift_180s_m is None
    assert report.map_drift_m == pytest.approx(0.3)
    assert report.map_restarts == 0


def test_a_map_that_was_begun_anew_is_aligned_where_it_begins() -> None:
    """After the drone was carried 2 m aside, its new map begins there without drift."""
    flight = Flight()
    flight.map = site_map()
    flight.at(1.0, taking_off=True)
    for time_s, off_m in ((10.0, 0.0), (11.0, 0.1)):
        flight.map = site_map(*in_map(0.0, off_m), restarts=1)
        flight.at(time_s, Pose(x_m=0.0, y_m=2.0, z_m=1.5, yaw_rad=0.0))
    report = flight.report()
    assert report.map_drift_m == pytest.approx(0.1)
    assert report.map_restarts == 1


def test_a_map_that_is_not_new_is_not_compared_with_where_the_drone_is_by_now() -> None:
    flight = Flight()
    flight.map = site_map()
    flight.at(1.0, taking_off=True)
    flight.at(2.0, Pose(x_m=3.0, y_m=0.0, z_m=1.5, yaw_rad=0.0))
    assert flight.report().map_drift_m == pytest.approx(0.0)


@pytest.mark.parametrize("referee", [True, False])
def test_without_a_map_or_a_referee_there_is_no_result(*, referee: bool) -> None:
    flight = Flight(box(BOX_1, 1.0, 1.0))
    if not referee:
        flight.map = site_map()
        flight.log = FlightLog(map_check=MapCheck(Ground(size_m=(5.0, 4.0)), lambda: flight.map))
    flight.at(1.0, taking_off=True, referee=referee)
    report = flight.report().to_json()
    fields = {name for name in report if name.startswith(("map_", "object", "false"))}
    assert len(fields) == 9
    assert all(report[name] is None for name in fields)
