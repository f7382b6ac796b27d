"""Samples of the control student: from flights, with the state of motion."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from perception.control.ego_state import mirrored, state_size, state_vector
from perception.control.training.run import mirrored_windows, relit
from perception.control.training.samples import ControlSamples, read_flight, write_flight
from tests.perception.control.control_world import TINY, flight_of, made_up_flight, picture
from uav_bt.answers import Advance, Answer, Blocked, Done, FollowLeg, Rotate
from uav_bt.errors import ValueRangeError
from uav_bt.types.dead_reckoning import OdometryPose

FREE = Advance(forward_m=0.6, free_m=1.0)
BLOCKED = Blocked(yaw_rad=0.5, ground_ends=True, free_m=0.2)


def samples_of(*decisions: Answer, near_weight: float = 2.0, **changed: object) -> ControlSamples:
    flight = flight_of(decisions, np.random.default_rng(0), **changed)
    return ControlSamples([flight], TINY, near_weight)


def test_a_picture_comes_back_as_it_was_to_a_few_grey_levels() -> None:
    flight = flight_of([FREE, BLOCKED], np.random.default_rng(0))
    rng = np.random.default_rng(0)
    for index, answer in enumerate([FREE, BLOCKED]):
        assert np.abs(flight.image(index).astype(int) - picture(answer, rng)).mean() < 6.0


def test_a_window_looks_back_in_time() -> None:
    """The present view, and those half a second and a second before; with the way between them.

    Where there is no past yet the oldest view stands for it.
    """
    samples = samples_of(*[FREE] * 20)
    batch = samples.window([15])
    assert batch.frames.shape == (1, 3, 16, 32, 3)
    assert batch.state[0, 4:6] == pytest.approx([0.5, -0.2], abs=1e-6)
    assert batch.state[0, 9:11] == pytest.approx([1.0, -0.4], abs=1e-6)
    assert samples.window([2]).state[0, [4, 9]] == pytest.approx([0.2, 0.2], abs=1e-6)


def test_labels_are_the_rules_answer_and_an_unknown_free_way_is_no_number() -> None:
    batch = samples_of(FREE, BLOCKED, replace(FREE, free_m=None)).window([0, 1, 2])
    expected = [[0.6, 0.0, 0.0, 1.0], [0.0, 0.5, 1.0, 0.2], [0.6, 0.0, 0.0, np.nan]]
    assert batch.labels == pytest.approx(np.array(expected), abs=1e-6, nan_ok=True)


@pytest.mark.parametrize("answer", [FollowLeg(speed_mps=0.4), Rotate(yaw_rad=0.3), Done()])
def test_answers_that_the_student_cannot_give_are_refused(answer: Answer) -> None:
    with pytest.raises(ValueRangeError, match=r"are Advance or Blocked, got .*<Advise policy="):
        samples_of(answer)


def test_a_fresh_view_has_the_fresh_label_and_no_turn() -> None:
    """Half of the views with a turn under way are shown as if there were none."""
    samples = samples_of(BLOCKED, turning=1, full_turns=1, fresh=FREE)
    drawn = samples.draw(np.random.default_rng(0), 100)
    fresh = drawn.labels[:, 0] > 0.0
    assert 35 < fresh.sum() < 65
    assert (drawn.turning == ~fresh).all()
    assert (drawn.state[fresh, 2:4] == 0.0).all()
    assert (drawn.state[~fresh, 2] == 1.0).all()


def test_views_near_obstacles_are_drawn_more_often() -> None:
    samples = samples_of(*[FREE] * 30, *[BLOCKED] * 10, near_weight=3.0)
    assert samples.near_share == pytest.approx(0.25)
    drawn = samples.draw(np.random.default_rng(1), 2000).labels[:, 0]
    assert (drawn == 0.0).mean() == pytest.approx(0.5, abs=0.05)


def test_views_of_other_parts_of_the_mission_are_left_out() -> None:
    for changed in ({"gimbal_pitch_rad": -1.3}, {"height_above_ground_m": 0.5}):
        with pytest.raises(ValueRangeError, match="no view to learn from"):
            samples_of(FREE, BLOCKED, **changed)
    with pytest.raises(ValueRangeError, match="0 flights hold no view"):
        ControlSamples([], TINY)


def test_a_flight_survives_its_file(tmp_path: Path) -> None:
    flight = made_up_flight(views=5)
    write_flight(tmp_path / "views" / "a.npz", flight)
    back = read_flight(tmp_path / "views" / "a.npz")
    assert (back.labels == flight.labels).all()
    assert (back.image(4) == flight.image(4)).all()
    assert back.pose(3) == flight.pose(3)


def test_a_mirrored_window_turns_the_other_way() -> None:
    batch = samples_of(BLOCKED, BLOCKED, BLOCKED, turning=1).window([0, 1, 2])
    turned = mirrored_windows(batch, np.array([True, True, False]))
    assert (turned.frames[:2] == batch.frames[:2, ..., ::-1, :]).all()
    assert (turned.frames[2] == batch.frames[2]).all()
    assert (turned.labels == batch.labels * [[1, -1, 1, 1], [1, -1, 1, 1], [1, 1, 1, 1]]).all()
    assert turned.turning.tolist() == turned.state[:, 2].tolist() == [-1.0, -1.0, 1.0]


def test_other_light_changes_pictures_a_little() -> None:
    frames = samples_of(BLOCKED, FREE).window([0, 1]).frames
    lit = relit(frames, np.random.default_rng(0))
    assert 1.0 < np.abs(lit.astype(int) - frames).mean() < 60.0


# --- the control student's inputs besides the pixels ----------------------------------------------

NOW = OdometryPose(time_s=10.0, x_m=2.0, y_m=1.0, yaw_rad=math.pi / 2)  # it looks along y
THEN = OdometryPose(time_s=9.5, x_m=1.9, y_m=0.7, yaw_rad=math.pi / 2 - 0.2)


def told(*poses: OdometryPose, **changed: float) -> np.ndarray:
    values: Any = {"height_above_ground_m": 1.7, "gimbal_pitch_rad": math.radians(-20)}
    return state_vector(poses, **{**values, "turning": -1, "full_turns": 2, **changed})


def test_the_usual_stand_is_nought() -> None:
    usual = {"height_above_ground_m": 1.5, "gimbal_pitch_rad": math.radians(-30)}
    assert told(NOW, NOW, **usual, turning=0, full_turns=0) == pytest.approx([0.0] * 9, abs=1e-6)


def test_the_state_vector_has_differences_from_the_usual() -> None:
    numbers = told(NOW)
    assert numbers == pytest.approx([0.2, math.radians(10), -1.0, 2 / 3], abs=1e-6)
    assert numbers.dtype == np.float32
    assert told(NOW, full_turns=9)[3] == 1.0  # the rules relieve three turns at most
    for views in (1, 2, 3):
        assert told(*[NOW] * views).shape == (state_size(views),)


def test_an_earlier_view_is_relative_to_the_body_now() -> None:
    """It came from 0.3 m behind and 0.1 m to the right, and has turned clockwise since."""
    assert told(NOW, THEN)[4:] == pytest.approx(
        [0.5, -0.3, 0.1, math.sin(-0.2), 1 - math.cos(0.2)], abs=1e-6
    )


def test_a_mirror_exchanges_left_and_right_and_nothing_else() -> None:
    numbers = told(NOW, THEN)
    turned = mirrored(np.stack([numbers, numbers]))[1]
    assert turned == pytest.approx(numbers * [1, 1, -1, 1, 1, 1, -1, -1, 1])
    assert mirrored(turned) == pytest.approx(numbers)
