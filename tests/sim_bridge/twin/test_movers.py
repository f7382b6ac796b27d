"""Movers: positions over time, invalid paths, and contacts with a drone."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_bridge.twin.drone import TwinDrone
from sim_bridge.twin.movers import MoverSpec
from sim_bridge.twin.routes import Traffic
from sim_bridge.twin.scene import Scene, traffic_problem
from sim_bridge.twin.scene_file import load_scene, scene_text
from sim_bridge.twin.variation import start_pose, varied_scene, with_movers
from tests.paper_lab import BOXES
from tests.sim_bridge.twin.lab_world import fly
from uav_bt.errors import SceneError, ValueRangeError
from uav_bt.types import Hover, MoverState, Truth, Velocity

MakeTwin = Callable[..., TwinDrone]

WALK = MoverSpec(path_m=((0.0, -1.0), (0.0, 1.0)), speed_mps=0.5)
ROUND = MoverSpec(path_m=((0.0, 0.0), (2.0, 0.0), (2.0, 1.0)), speed_mps=1.0, loop=True)
GOOD = """\
helipad: {position_m: [-2.0, -1.4]}
boxes:
  - {pattern: 1, position_m: [1.5, 1.0], size_m: [0.4, 0.4, 1.8]}
movers:
  - {path_m: [[0.0, -1.2], [0.0, 1.2]], speed_mps: 0.5, pattern: 3}
  - {shape: box, path_m: [[1.0, -1.0], [2.0, -1.0]], speed_mps: 0.3, size_m: [0.5, 0.3, 0.9]}
take_off: {from: [-1.0, 0.0], yaw_deg: 0}
"""


def at(spec: MoverSpec, time_s: float, seed: int = 0) -> MoverState:
    (state,) = Traffic([spec], seed).at(time_s)
    return state


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "moving.yaml"
    path.write_text(text, encoding="utf-8")
    return path


# --- routes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("time_s", "y_m", "vy_mps"),
    [(0.0, -1.0, 0.5), (1.0, -0.5, 0.5), (3.0, 0.5, 0.5), (5.0, 0.5, -0.5), (9.0, -0.5, 0.5)],
)
def test_to_and_fro_at_a_constant_speed(time_s: float, y_m: float, vy_mps: float) -> None:
    state = at(WALK, time_s)
    assert (state.pose.x_m, state.pose.y_m) == pytest.approx((0.0, y_m))
    assert (state.vx_mps, state.vy_mps) == pytest.approx((0.0, vy_mps))
    assert (state.name, state.pose.z_m) == ("mover-1", 0.85)


def test_a_loop_comes_back_to_its_first_corner() -> None:
    around_s = 2.0 + 1.0 + math.sqrt(5.0)
    assert (at(ROUND, 2.5).pose.x_m, at(ROUND, 2.5).pose.y_m) == pytest.approx((2.0, 0.5))
    homeward = at(ROUND, 3.0 + math.sqrt(5.0) / 2)
    assert (homeward.pose.x_m, homeward.pose.y_m) == pytest.approx((1.0, 0.5))
    assert (homeward.vx_mps, homeward.vy_mps) == pytest.approx(
        (-2.0 / math.sqrt(5.0), -1.0 / math.sqrt(5.0))
    )
    assert at(ROUND, around_s + 0.5).pose.x_m == pytest.approx(0.5)


def test_velocity_is_how_the_place_changes() -> None:
    spec = replace(ROUND, pauses_s=(1.0, 2.0))
    traffic = Traffic([spec], 4)
    for time_s in np.arange(0.05, 30.0, 0.37):
        (before,), (now,), (after,) = (traffic.at(time_s + d) for d in (-1e-5, 0.0, 1e-5))
        if (before.vx_mps, before.vy_mps) == (after.vx_mps, after.vy_mps):
            speed = (after.pose.x_m - before.pose.x_m) / 2e-5
            assert now.vx_mps == pytest.approx(speed, abs=1e-3)


def test_pauses_come_from_the_seed_and_last_as_long_as_the_file_says() -> None:
    spec = replace(WALK, pauses_s=(2.0, 3.0))
    times = np.arange(0.0, 40.0, 0.01)
    rests = np.array([state.vy_mps == 0.0 for state in _states(spec, 7, times)])
    starts = np.flatnonzero(np.diff(rests.astype(int)) == 1)
    ends = np.flatnonzero(np.diff(rests.astype(int)) == -1)
    assert rests[0], "it stands before the first way, too"
    lengths = (ends[1:] - starts[: len(ends) - 1]) * 0.01
    assert len(lengths) >= 4
    assert lengths.min() >= 1.98
    assert lengths.max() <= 3.02
    assert len(set(np.round(lengths, 2))) > 1
    assert _states(spec, 7, times) == _states(spec, 7, times)
    assert _states(spec, 7, times) != _states(spec, 8, times)


def _states(spec: MoverSpec, seed: int, times: np.ndarray) -> list[MoverState]:
    traffic = Traffic([spec], seed)
    return [traffic.at(float(time_s))[0] for time_s in times]


def test_asking_for_an_earlier_time_gives_what_was_then() -> None:
    spec = replace(WALK, pauses_s=(0.5, 4.0))
    traffic = Traffic([spec], 1)
    early = traffic.at(3.0)
    traffic.at(500.0)
    assert traffic.at(3.0) == early


# --- scene files ----------------------------------------------------------------------------------


def test_movers_are_read_and_written_again(tmp_path: Path) -> None:
    scene = load_scene(written(tmp_path, GOOD))
    first, second = scene.movers
    assert (first.shape, first.size_m, first.pattern) == ("cylinder", (0.4, 0.4, 1.7), 3)
    assert (second.shape, second.loop, second.pauses_s) == ("box", False, None)
    again = tmp_path / "again.yaml"
    again.write_text(scene_text(scene), encoding="utf-8")
    assert load_scene(again) == scene


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("[0.0, 1.2]]", "[2.9, 1.2]]", 5, "mover-1: its path leaves the ground at [2.9, 1.2]"),
        ("[2.0, -1.0]]", "[1.6, 1.6]]", 6, "mover-2: its path leads through box-1 from"),
        ("[2.0, -1.0]]", "[-2.3, -1.4]]", 6, "mover-2: its path leads through the landing mark"),
        ("[0.0, 1.2]]", "[-1.8, 0.9]]", 5, "mover-1: its path comes within 0.25 m of the take-off"),
        ("speed_mps: 0.5", "speed_mps: 1.5", 5, "speed_mps must be 0.2 to 1.0, got 1.5"),
        ("pattern: 3", "pattern: 9", 5, "pattern must be 1 to 8, got 9"),
        ("[[0.0, -1.2], [0.0, 1.2]]", "[[0.0, -1.2]]", 5, "at least two corners"),
        ("pattern: 3", "size_m: [0.4, 0.5, 1.7]", 5, "as wide as it is deep"),
        ("pattern: 3", "pauses_s: [3, 1]", 5, "least and the most, 0 to 60 s, got [3.0, 1.0]"),
        ("pattern: 3", "shape: cone", 5, "got 'cone'"),
    ],
)
def test_a_mover_that_cannot_be_is_refused_with_its_line(
    tmp_path: Path, old: str, new: str, line: int, message: str
) -> None:
    assert old in GOOD
    path = written(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert str(caught.value).startswith(f"{path}:{line}: ")
    assert message in str(caught.value)


def test_corners_of_a_path_may_be_exactly_a_tenth_of_a_metre_apart() -> None:
    """Between -0.5 and -0.6 the floats are 0.0999... apart."""
    assert math.dist((-0.5, -1.0), (-0.6, -1.0)) < 0.1
    MoverSpec(path_m=((-0.5, -1.0), (-0.6, -1.0)), speed_mps=0.5)
    with pytest.raises(ValueRangeError, match=r"0\.1 m apart or more, got"):
        MoverSpec(path_m=((-0.5, -1.0), (-0.599, -1.0)), speed_mps=0.5)


def test_a_round_mover_may_pass_a_corner_that_a_square_one_would_hit(tmp_path: Path) -> None:
    """Its radius is less than the gap to the box's corner; half a square's diagonal is more."""
    diagonal = "path_m: [[0.4, 1.018], [1.4, 0.018]], speed_mps: 0.3"
    text = GOOD.replace("path_m: [[0.0, -1.2], [0.0, 1.2]], speed_mps: 0.5", diagonal)
    gap_m = abs(1.3 + 0.8 - 1.418) / math.sqrt(2.0)
    assert 0.25 < gap_m < 0.6
    near = text.replace("pattern: 3", f"size_m: [{2 * gap_m - 0.02}, {2 * gap_m - 0.02}, 1]")
    load_scene(written(tmp_path, near))
    with pytest.raises(SceneError, match="through box-1"):
        load_scene(written(tmp_path, near.replace("- {path_m", "- {shape: box, path_m", 1)))


# --- scenes with random movers --------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(12))
def test_drawn_movers_leave_the_pad_and_the_boxes_alone(seed: int) -> None:
    scene = load_scene("test-a")
    moving = with_movers(scene, 2, seed)
    assert len(moving.movers) == 2
    assert moving == with_movers(scene, 2, seed)
    assert moving != with_movers(scene, 2, seed + 100)
    assert traffic_problem(scene, moving.movers) is None
    for mover in moving.movers:
        assert mover.distance_m(*scene.helipad.position_m) >= 0.9
        assert math.dist(*mover.path_m) >= 1.0
    assert replace(moving, movers=()) == scene


def test_there_is_no_room_for_a_mover_between_walls() -> None:
    scene = load_scene("train-a")
    with pytest.raises(ValueRangeError, match=r"takes at most 8 more, got 9"):
        with_movers(scene, 9, 0)


def test_drawn_boxes_and_starts_keep_off_the_paths(tmp_path: Path) -> None:
    scene = load_scene(written(tmp_path, GOOD))
    for seed in range(5):
        drawn = varied_scene(scene, np.random.default_rng(seed), name="drawn", layout=True)
        assert drawn.movers == scene.movers
    anywhere = load_scene(
        written(tmp_path, GOOD.replace("from: [-1.0, 0.0], yaw_deg: 0", "from: random"))
    )
    for seed in range(20):
        pose = start_pose(anywhere, seed)
        assert all(m.distance_m(pose.x_m, pose.y_m) >= 0.5 for m in anywhere.movers)


# --- in the simulation ----------------------------------------------------------------------------

MEETING = """
helipad: {position_m: [-1.5, -1.5]}
movers:
  - {path_m: [[1.0, -1.5], [1.0, 1.5]], speed_mps: 0.5, pattern: 3}
take_off: {from: [-1.0, 0.0], yaw_deg: 0}
"""


def truth_of(drone: TwinDrone) -> Truth:
    assert drone.referee is not None
    return drone.referee.truth()


def test_the_truth_has_the_movers_and_they_count_for_the_clearance(
    make_twin: MakeTwin, tmp_path: Path
) -> None:
    drone = make_twin(scene=str(written(tmp_path, MEETING)))
    drone.clock.sleep_until(2.0)
    truth = truth_of(drone)
    (mover,) = truth.movers
    assert (mover.pose.x_m, mover.pose.y_m) == pytest.approx((1.0, -0.5))
    assert (mover.vx_mps, mover.vy_mps) == pytest.approx((0.0, 0.5))
    drone.clock.sleep_until(3.0)
    gap_m = 2.0 - 0.2 - 0.12  # abreast: from the mover's side to the front of the hull
    assert truth_of(drone).clearance_m == pytest.approx(gap_m, abs=0.002)


def test_flying_into_a_mover_is_a_contact_with_its_name(
    make_twin: MakeTwin, tmp_path: Path
) -> None:
    drone = make_twin(scene=str(written(tmp_path, MEETING)), airborne=True)
    touched: set[str] = set()
    for _ in range(100):
        fly(drone, Velocity(forward_mps=0.4 if truth_of(drone).pose.x_m < 0.9 else 0.0), 0.1)
        touched |= set(truth_of(drone).contacts)
    assert touched == {"mover-1"}


def test_a_mover_drives_into_a_drone_that_hovers(make_twin: MakeTwin, tmp_path: Path) -> None:
    """A collision counts even if the drone does not move."""
    text = MEETING.replace("[[1.0, -1.5], [1.0, 1.5]]", "[[1.0, 1.0], [-0.5, 1.0], [-0.5, -0.6]]")
    drone = make_twin(scene=str(written(tmp_path, text)), airborne=True)
    fly(drone, Velocity(forward_mps=0.3), 1.5)
    touched: set[str] = set()
    for _ in range(200):
        fly(drone, Hover(), 0.1)
        touched |= set(truth_of(drone).contacts)
    assert touched == {"mover-1"}


def test_an_image_shows_movers_where_they_were_when_it_was_taken(
    make_twin: MakeTwin, tmp_path: Path
) -> None:
    """The frame is delivered late, and its masks and depth are requested even later."""
    text = MEETING.replace("[[1.0, -1.5], [1.0, 1.5]]", "[[1.0, 0.0], [2.0, 0.0]]")
    drone = make_twin(scene=str(written(tmp_path, text)), image_size_px=(320, 180))
    drone.clock.sleep_until(1.0)
    frame = drone.observe().frame
    assert frame is not None
    drone.clock.sleep_until(3.0)
    assert drone.referee is not None
    ids = drone.referee.class_ids(frame, 320, 180)
    depth = drone.referee.depth(frame, 320, 180)
    lens_x = -1.0 + 0.15
    gone_m = 0.5 * frame.captured_s
    assert ids[90, 160] == BOXES[2]
    assert depth[90, 160] == pytest.approx(1.0 + gone_m - 0.2 - lens_x, abs=0.003)
    assert truth_of(drone).movers[0].pose.x_m == pytest.approx(1.0 + 0.5 * 1.0)


def test_the_height_above_what_lies_below_counts_a_cart(
    make_twin: MakeTwin, tmp_path: Path
) -> None:
    cart = "shape: box, size_m: [0.6, 0.6, 0.5], path_m: [[0.8, 0.0], [1.0, 0.0]], speed_mps: 0.2"
    text = MEETING.replace("path_m: [[1.0, -1.5], [1.0, 1.5]], speed_mps: 0.5", cart)
    drone = make_twin(scene=str(written(tmp_path, text)), airborne=True)
    fly(drone, Velocity(forward_mps=0.4), 5.0)
    state, truth = drone.observe().state, truth_of(drone)
    (mover,) = truth.movers
    assert abs(truth.pose.x_m - mover.pose.x_m) < 0.3, "the drone is above the cart"
    assert state.height_above_ground_m - state.height_m == pytest.approx(0.5, abs=0.05)


def test_a_scene_without_movers_has_none_in_its_truth(make_twin: MakeTwin) -> None:
    assert truth_of(make_twin()).movers == ()


def test_a_scene_is_checked_wherever_it_is_made() -> None:
    scene = load_scene("train-a")
    with pytest.raises(ValueRangeError, match="mover-1: its path leads through box-3"):
        Scene(
            name="x",
            helipad=scene.helipad,
            boxes=scene.boxes,
            movers=(MoverSpec(path_m=((0.0, 0.1), (2.0, 0.1)), speed_mps=0.5),),
        )
