"""The mission's map: against the truth, and its faults; one without any ground ends the mission."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.worlds import values
from tests.worlds.tables import cases
from uav_bt.mission.flight_log import FlightLog
from uav_bt.mission.flight_report import FlightReport
from uav_bt.mission.map_check import MapAlignment, MapCheck, MapWatch
from uav_bt.types import Attitude, DroneState, FlyingState, Pose, Pose2D, TakeOff
from uav_bt.types.ground import Footprint, Ground, Standing
from uav_bt.types.site_map import MapMark, MapObject, SiteMap

CASES = cases("mission")["map_check"]
BOX_1, BOX_2 = 4, 5
START = Pose(x_m=-1.0, y_m=0.5, z_m=0.0, yaw_rad=math.radians(30))
REPORTED_RAD = math.radians(20)  # clockwise: the map's x axis is at 50 degrees in the world


def site_map(
    x_m: float = 0.0, y_m: float = 0.0, *objects: tuple[int, float, float], **changes: Any
) -> SiteMap:
    given = {
        "pose": Pose2D(x_m=x_m, y_m=y_m, yaw_rad=REPORTED_RAD),
        "objects": tuple(
            MapObject(class_id=class_id, x_m=x, y_m=y, size_m=0.4, std_m=0.1, seen_s=0.0)
            for class_id, x, y in objects
        ),
    }
    return values.site_map(5, **{**given, **changes})


def at(x_m: float, y_m: float) -> Pose:
    return Pose(x_m=x_m, y_m=y_m, z_m=1.5, yaw_rad=START.yaw_rad)


def in_map(x_m: float, y_m: float) -> tuple[float, float]:
    """Return a world point in the map's frame, computed independently; y is to the right."""
    along_rad = math.radians(50)
    dx, dy = x_m - START.x_m, y_m - START.y_m
    ahead = dx * math.cos(along_rad) + dy * math.sin(along_rad)
    right = dx * math.sin(along_rad) - dy * math.cos(along_rad)
    return ahead, right


# --- its place in the world -----------------------------------------------------------------------


def test_a_map_is_mirrored_turned_and_moved_into_the_world() -> None:
    """Noise of the reported yaw does not turn it, nor a drift in flight."""
    alignment = MapAlignment()
    alignment.add(0.0, START, REPORTED_RAD, None)
    assert alignment.placement is None
    for index in range(1, 11):
        noise_rad = 0.05 if index % 2 else -0.05
        alignment.add(index / 10, START, REPORTED_RAD + noise_rad, site_map())
    alignment.add(5.0, START, REPORTED_RAD + 1.0, site_map())
    placement = alignment.placement
    assert placement is not None
    corner = np.array([in_map(2.0, -1.5), in_map(-1.0, 0.5)])
    assert placement.to_world(corner) == pytest.approx(np.array([[2.0, -1.5], [-1.0, 0.5]]))
    pose = placement.pose_to_world(site_map().pose)
    assert (pose.x_m, pose.y_m, pose.yaw_rad) == pytest.approx((-1.0, 0.5, math.radians(30)))


# --- against the truth ----------------------------------------------------------------------------


class Flight:
    """A flight's log, with a map that the test sets; the take-off is commanded at 1 s."""

    def __init__(self, *standing: Standing, referee: bool = True) -> None:
        self.map: SiteMap | None = None
        self.referee = referee
        ground = Ground(size_m=(5.0, 4.0), standing=standing)
        self.log = FlightLog(map_check=MapCheck(ground, lambda: self.map))
        self.at(0.0)

    def at(self, time_s: float, pose: Pose = START) -> None:
        state = DroneState(
            captured_s=time_s,
            flying=FlyingState.FLYING,
            attitude=Attitude(yaw_rad=REPORTED_RAD),
        )
        truth = values.truth(pose, time_s, clearance_m=math.inf) if self.referee else None
        self.log.on_tick(values.tick(state, TakeOff() if time_s == 1.0 else None, truth=truth))

    def report(self) -> FlightReport:
        return values.report(self.log)


def box(class_id: int | None, x_m: float, y_m: float) -> Standing:
    footprint = Footprint(x_m=x_m, y_m=y_m, half_x_m=0.2, half_y_m=0.2)
    return Standing(footprint=footprint, height_m=1.0, class_id=class_id)


def test_objects_are_found_by_class_and_place() -> None:
    of_wall, mark = box(0, 2.0, 0.0), box(None, 0.0, 0.0)
    flight = Flight(box(BOX_1, 1.0, 1.0), box(BOX_2, -1.0, -1.0), of_wall, mark)
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
    assert report.object_height_errors_m == []
    measured = [replace(one, height_m=0.97) for one in flight.map.objects]
    flight.map = replace(flight.map, objects=tuple(measured))
    flight.at(0.2)
    assert flight.report().object_height_errors_m == pytest.approx([-0.03])


@pytest.mark.parametrize(("ticks", "expected"), CASES["drift"])
def test_the_drift_is_measured_after_the_take_off_and_at_the_end(
    ticks: list[Any], expected: list[float | None]
) -> None:
    """Each tick has a time, the true place, the believed one, and the number of new beginnings."""
    flight = Flight()
    flight.map = site_map()
    flight.at(1.0)
    for time_s, true, believed, restarts in ticks:
        if believed is not None:
            flight.map = site_map(*in_map(*believed), restarts=restarts)
        flight.at(time_s, at(*true))
    report = flight.report()
    drifts = (report.map_drift_90s_m, report.map_drift_180s_m, report.map_drift_m)
    assert (*drifts, report.map_restarts) == pytest.approx(tuple(expected))


@pytest.mark.parametrize("referee", [True, False])
def test_without_a_map_or_a_referee_there_is_no_result(*, referee: bool) -> None:
    flight = Flight(box(BOX_1, 1.0, 1.0), referee=referee)
    if not referee:
        flight.map = site_map()
    flight.at(1.0)
    report = flight.report().to_json()
    fields = {name for name in report if name.startswith(("map_", "object", "false"))}
    assert len(fields) == 10
    assert all(report[name] is None for name in fields)


# --- its faults -----------------------------------------------------------------------------------

TICK_S = 0.1
MARK = MapMark(x_m=1.0, y_m=0.0, std_m=0.05, seen_s=0.0)
GROUND = site_map(seen_s=np.zeros((5, 5)), mark=MARK)
SEEN = replace(GROUND, seen_s=np.full((5, 5), 1e6))
MAPS: dict[str | None, SiteMap | None] = {
    None: None,
    "GROUND": GROUND,
    "SEEN": SEEN,
    "NO_GROUND": replace(GROUND, seen_s=np.full((5, 5), -np.inf), mark=None),
    "FULL": replace(SEEN, full=True),
    "ANEW": replace(SEEN, restarts=1),
    "TWICE_ANEW": replace(SEEN, restarts=2),
    "MOVED": replace(SEEN, mark=replace(MARK, moved_m=1.2)),
    "MOVED_ON": replace(SEEN, mark=replace(MARK, moved_m=2.0)),
}


@pytest.mark.parametrize(("maps", "airborne", "words", "trouble"), CASES["faults"])
def test_what_is_wrong_is_named_for_some_seconds_or_while_it_lasts(
    maps: dict[str | None, int], words: str, trouble: str | None, *, airborne: bool
) -> None:
    """Each map was captured in its tick."""
    watch = MapWatch()
    flown = [MAPS[name] for name, ticks in maps.items() for _ in range(ticks)]
    for tick, each in enumerate(flown):
        now_s = tick * TICK_S
        watch.update(each and replace(each, captured_s=now_s), now_s, airborne=airborne)
    assert watch.trouble == trouble
    assert words in "; ".join(watch.warnings)
    assert bool(words) is bool(watch.warnings)
