"""The numbers of a mission: their values, and the values of unknown numbers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.worlds import values
from tests.worlds.tables import cases
from uav_bt.board import MARK, MISSION_KEYS, ODOMETRY, SITE_MAP
from uav_bt.board.blackboard import Blackboard
from uav_bt.board.context import FlightNotes
from uav_bt.board.keys import QUIET
from uav_bt.clock import ManualClock
from uav_bt.mission.judge import Judge, JudgeConfig
from uav_bt.mission.mission_numbers import MissionNumbers, Whereabouts
from uav_bt.mission.position_hold import BLIND_S
from uav_bt.testing import blank_frame
from uav_bt.types import CameraModel, MapMark, MapObject, MarkFix, Observation, Pose2D
from uav_bt.types.area import Area
from uav_bt.types.dead_reckoning import OdometryPose
from uav_bt.types.drone_state import DroneState, FlyingState
from uav_bt.types.flight_results import Photo

AREA = Area((((-2.0, -2.0), (4.0, -2.0), (4.0, 2.0), (-2.0, 2.0)),))
CAMERA = CameraModel(width_px=8, height_px=6, fx_px=8.0, fy_px=8.0, cx_px=4.0, cy_px=3.0)


class World:
    """A board with the numbers of a mission, whose clock the test moves."""

    def __init__(self, area: Area | None = None, judge: Judge | None = None) -> None:
        self.clock = ManualClock()
        self.board = Blackboard(self.clock, MISSION_KEYS)
        self.notes = FlightNotes()
        self.whereabouts = Whereabouts(self.board, area)
        self.numbers = MissionNumbers(self.board, self.notes, self.whereabouts, judge or Judge())

    def tick(
        self, state: DroneState | None = None, *, frame_s: float | None = None
    ) -> dict[str, float]:
        """Update the place as the last tick did, write, and return the numbers by key."""
        now_s = self.clock.now()
        state = state or DroneState(captured_s=now_s, flying=FlyingState.FLYING)
        frame = None
        if frame_s is not None:
            frame = blank_frame(CAMERA, replace(state, captured_s=frame_s), index=0)
        self.whereabouts.update()
        self.numbers.write(Observation(frame=frame, state=state), now_s)
        values = self.board.snapshot()
        return {key.name: values[key.name][0] for key in QUIET}

    def move(
        self, x_m: float, y_m: float, yaw_deg: float = 0.0, *, untracked_s: float = 0.0
    ) -> None:
        now_s = self.clock.now()
        pose = OdometryPose(x_m=x_m, y_m=y_m, yaw_rad=math.radians(yaw_deg), time_s=now_s)
        motion = values.motion(pose, tracked_s=now_s - untracked_s)
        self.board.write(ODOMETRY, motion, captured_s=now_s)

    def map(self, **changes: object) -> None:
        """Write a map of 10 x 10 cells that were seen now, a quarter of them passed."""
        now_s, passed = self.clock.now(), np.zeros((10, 10), dtype=bool)
        passed[:5, :5] = True
        given = {"captured_s": now_s, "seen_s": np.full((10, 10), now_s), "passed": passed}
        self.board.write(SITE_MAP, values.site_map(10, **(given | changes)))


def test_a_mission_without_perception_knows_the_drone_alone() -> None:
    state = DroneState(captured_s=0.0, flying=FlyingState.LANDED, battery=None, link=None)
    assert World(AREA).tick(state) == cases("mission")["numbers"]


def test_old_telemetry_photographs_and_the_time_left_are_counted() -> None:
    judge = Judge(JudgeConfig(time_limit_s=50.0))
    judge.took_off(0.0)
    world = World(judge=judge)
    heard = DroneState(
        captured_s=world.clock.now(), flying=FlyingState.FLYING, battery=0.6, link=0.3
    )
    world.clock.advance(4.0)
    photo = {"label": "", "file": None, "class_map": None, "time_s": 1.0, "pose": None}
    world.notes.photos.append(Photo(**photo, height_m=1.5, gimbal_pitch_deg=-30.0))  # type: ignore[arg-type]
    now = world.tick(heard)
    assert (now["unheard_s"], now["photos_count"], now["time_left_s"]) == (4.0, 1.0, 46.0)
    assert (now["battery_share"], now["link_share"], now["flying"]) == (0.6, 0.3, 1.0)


def charge(now_s: float, charge: float | None, *, flies: bool = True) -> DroneState:
    flying = FlyingState.FLYING if flies else FlyingState.LANDED
    return DroneState(captured_s=now_s, flying=flying, battery=charge)


@pytest.mark.parametrize("step", [0.0, 0.01])
@pytest.mark.parametrize("seconds", [19, 25, 60, 400])
def test_battery_use_is_overestimated_by_a_step_at_most(seconds: int, step: float) -> None:
    """It is known after 20 s; the battery reports in steps."""
    world, use = World(), -1.0
    for now_s in range(seconds + 1):
        left = 0.9 - 0.04 * now_s / 60.0
        told = charge(now_s, round(left / step) * step if step else left)
        use = world.tick(told)["battery_per_min"]
        world.clock.advance(1.0)
    assert (use == -1.0) is (seconds < 20)
    assert seconds < 20 or 0.04 - 1e-9 <= use <= 0.04 + 60.0 * 0.021 / seconds


def test_the_next_flight_is_measured_anew_and_time_on_the_ground_does_not_count() -> None:
    """A battery that reports nothing is left out."""
    world, uses = World(), []
    for after_s, left, flies in (
        *((0.0, 0.9, True), (50.0, None, True), (10.0, 0.86, True), (540.0, 0.8, False)),
        *((100.0, 0.8, True), (60.0, 0.6, True)),
    ):
        world.clock.advance(after_s)
        uses.append(world.tick(charge(world.clock.now(), left, flies=flies))["battery_per_min"])
    assert uses == pytest.approx([-1.0, -1.0, 0.05, 0.05, 0.05, 0.21])


def test_the_place_counts_from_the_take_off_pose() -> None:
    """The first pose looks along y of the odometry: a metre along it is a metre ahead."""
    world = World(AREA)
    world.move(5.0, 5.0, 90.0)
    world.tick()
    world.move(4.0, 8.0, -180.0)
    now = world.tick()
    assert (now["x_m"], now["y_m"]) == pytest.approx((3.0, 1.0))
    assert now["heading_deg"] == pytest.approx(90.0)
    assert now["home_m"] == pytest.approx(math.sqrt(10.0))
    assert now["area_margin_m"] == pytest.approx(1.0)
    assert World().tick()["area_margin_m"] == 9999.0


def test_the_map_corrects_the_place_and_its_correction_outlives_it() -> None:
    world = World()
    world.move(1.0, 0.0)
    world.tick()
    start = Pose2D(x_m=1.0, y_m=0.0, yaw_rad=0.0)
    world.map(correction=Pose2D(x_m=0.5, y_m=0.0, yaw_rad=0.0), start=start)
    world.move(2.0, 0.0)
    assert world.tick()["x_m"] == pytest.approx(1.5)
    world.clock.advance(5.0)
    world.move(3.0, 0.0)
    assert world.tick()["x_m"] == pytest.approx(2.5)
    world.clock.advance(5.0)
    assert world.tick()["x_m"] == 9999.0, "stale odometry is no place"


@pytest.mark.parametrize(
    ("untracked_s", "contradicted_s", "localised"),
    [(BLIND_S - 0.1, 0.9, 1), (BLIND_S + 0.1, 0.0, 0), (0.5, 1.1, 0)],
)
def test_a_drone_is_localised_while_ground_and_map_agree(
    untracked_s: float, contradicted_s: float, localised: int
) -> None:
    """For as long as the position hold keeps its place."""
    world = World()
    world.move(0.0, 0.0, untracked_s=untracked_s)
    assert world.tick()["localised"] == 0, "without a map"
    world.map(contradicted_s=contradicted_s)
    assert world.tick()["localised"] == localised


def test_the_map_is_counted_and_stays_counted_when_it_is_stale() -> None:
    world = World()
    box = MapObject(class_id=5, x_m=1.0, y_m=1.0, size_m=0.4, std_m=0.1, seen_s=0.0)
    world.map(objects=(box, box), mark=MapMark(x_m=1.0, y_m=1.0, std_m=0.1, seen_s=0.0))
    now = world.tick()
    assert (now["objects_count"], now["mark_known"], now["coverage_share"]) == (2, 1, 0.25)
    world.clock.advance(9.0)
    later = world.tick()
    assert (later["objects_count"], later["mark_known"], later["coverage_share"]) == (2, 1, 0.25)


def test_a_tracked_mark_is_known_until_it_is_stale_and_the_belief_falls_back_on_the_map() -> None:
    world = World()
    fix = MarkFix(captured_s=0.0, forward_m=1.0, right_m=0.0, height_m=0.4, detected=True)
    world.board.write(MARK, fix, captured_s=0.0)
    assert (world.tick()["mark_known"], world.whereabouts.mark_m()) == (1.0, 1.0)
    world.clock.advance(30.0)
    assert (world.tick()["mark_known"], world.whereabouts.mark_m()) == (0.0, None)
    mark = MapMark(x_m=3.0, y_m=4.0, std_m=0.1, seen_s=0.0)
    world.map(mark=mark, pose=Pose2D(x_m=3.0, y_m=3.5, yaw_rad=1.0))
    assert world.whereabouts.mark_m() == pytest.approx(0.5)


def test_blind_time_counts_frames_and_ground() -> None:
    world = World()
    assert world.tick(frame_s=0.0)["blind_s"] == 0.0
    world.clock.advance(2.0)
    assert world.tick(frame_s=0.5)["blind_s"] == pytest.approx(1.5)
    world.map()
    assert world.tick(frame_s=2.0)["blind_s"] == 0.0
    world.clock.advance(4.0)
    world.map(seen_s=np.full((10, 10), 2.0))
    assert world.tick(frame_s=6.0)["blind_s"] == pytest.approx(4.0)


def test_a_map_that_never_saw_ground_is_blind_from_its_beginning() -> None:
    world = World()
    world.clock.advance(1.0)
    for _ in range(2):
        world.map(seen_s=np.full((10, 10), -math.inf))
        blind_s = world.tick(frame_s=world.clock.now())["blind_s"]
        world.clock.advance(3.0)
    assert blind_s == pytest.approx(3.0)
