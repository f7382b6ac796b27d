"""Labelled views: kept small, drawn as windows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from perception.control.training.run import ControlAugmentConfig, augmented
from perception.control.training.samples import (
    ControlSamples,
    FlightBuilder,
    SampleConfig,
    read_flight,
    write_flight,
)
from tests.perception.control.control_world import TINY, advice, made_up_flight, picture
from uav_bt.answers import Advance, Answer, Blocked, Done, FollowLeg, Rotate
from uav_bt.errors import ShapeError, ValueRangeError

FREE = Advance(forward_m=0.6, free_m=1.0)
BLOCKED = Blocked(yaw_rad=0.5, ground_ends=True, free_m=0.2)


def flight_of(*decisions: Answer, **changed: object) -> ControlSamples:
    rng, builder = np.random.default_rng(0), FlightBuilder((32, 16))
    for index, decision in enumerate(decisions):
        builder.add(picture(decision, rng), advice(index, decision, **changed))
    return ControlSamples([builder.flight()], TINY)


def test_a_picture_comes_back_as_it_was_to_a_few_grey_levels() -> None:
    rng, builder = np.random.default_rng(0), FlightBuilder((32, 16))
    shown = [picture(decision, rng) for decision in (FREE, BLOCKED)]
    for index, rgb in enumerate(shown):
        builder.add(rgb, advice(index, FREE))
    flight = builder.flight()
    for index, rgb in enumerate(shown):
        assert np.abs(flight.image(index).astype(int) - rgb).mean() < 6.0


def test_a_window_looks_back_in_time() -> None:
    """The present view, and those half a second and a second before; with the way between them."""
    samples = flight_of(*[FREE] * 20)
    batch = samples.window([15])
    assert batch.frames.shape == (1, 3, 16, 32, 3)
    assert batch.state[0, 4:6] == pytest.approx([0.5, -0.2], abs=1e-6)
    assert batch.state[0, 9:11] == pytest.approx([1.0, -0.4], abs=1e-6)


def test_where_there_is_no_past_yet_the_oldest_view_stands_for_it() -> None:
    batch = flight_of(*[FREE] * 20).window([2])
    assert batch.state[0, [4, 9]] == pytest.approx([0.2, 0.2], abs=1e-6)


def test_labels_are_the_rules_answer() -> None:
    batch = flight_of(FREE, BLOCKED).window([0, 1])
    expected = [[0.6, 0.0, 0.0, 1.0], [0.0, 0.5, 1.0, 0.2]]
    assert batch.labels == pytest.approx(np.array(expected), abs=1e-6)


@pytest.mark.parametrize("answer", [FollowLeg(speed_mps=0.4), Rotate(yaw_rad=0.3), Done()])
def test_answers_that_the_student_cannot_give_are_refused(answer: Answer) -> None:
    with pytest.raises(ValueRangeError, match=r"are Advance or Blocked, got .*<Advise policy="):
        flight_of(answer)


def test_an_unknown_free_way_is_no_number() -> None:
    assert np.isnan(flight_of(replace(FREE, free_m=None)).window([0]).labels[0, 3])


def test_a_fresh_view_has_the_fresh_label_and_no_turn() -> None:
    """Half of the views with a turn under way are shown as if there were none."""
    rng, builder = np.random.default_rng(0), FlightBuilder((32, 16))
    shown = advice(0, BLOCKED, turning=1, full_turns=1, fresh=FREE)
    builder.add(picture(BLOCKED, rng), shown)
    flight = builder.flight()
    always = ControlSamples([flight], TINY, SampleConfig(fresh=1.0)).draw(rng, 4)
    never = ControlSamples([flight], TINY, SampleConfig(fresh=0.0)).draw(rng, 4)
    assert (always.labels[:, 0] > 0.0).all()
    assert (always.turning == 0.0).all()
    assert (always.state[:, 2:4] == 0.0).all()
    assert (never.labels[:, 0] == 0.0).all()
    assert (never.turning == 1.0).all()


def test_views_near_obstacles_are_drawn_more_often() -> None:
    flight = flight_of(*[FREE] * 30, *[BLOCKED] * 10)
    assert flight.near_share == pytest.approx(0.25)
    heavy = ControlSamples(flight._flights, TINY, SampleConfig(near_weight=3.0))
    drawn = heavy.draw(np.random.default_rng(1), 2000).labels[:, 0]
    assert (drawn == 0.0).mean() == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("changed", [{"gimbal_pitch_rad": -1.3}, {"height_above_ground_m": 0.5}])
def test_views_of_other_parts_of_the_mission_are_left_out(changed: dict[str, float]) -> None:
    with pytest.raises(ValueRangeError, match="no view to learn from"):
        flight_of(FREE, BLOCKED, **changed)


def test_no_flights_at_all_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="0 flights hold no view"):
        ControlSamples([], TINY)


def test_pictures_of_another_size_are_refused() -> None:
    with pytest.raises(ShapeError, match="64x16, got 32x16"):
        ControlSamples([made_up_flight()], replace(TINY, width_px=64))
    with pytest.raises(ShapeError, match="image must be 16x32x3, got 8x8x3"):
        FlightBuilder((32, 16)).add(np.zeros((8, 8, 3), np.uint8), advice(0, FREE))


def test_a_flight_survives_its_file(tmp_path: Path) -> None:
    flight = made_up_flight(views=5)
    write_flight(tmp_path / "views" / "a.npz", flight)
    back = read_flight(tmp_path / "views" / "a.npz")
    assert (back.labels == flight.labels).all()
    assert (back.image(4) == flight.image(4)).all()
    assert back.pose(3) == flight.pose(3)


def test_a_mirrored_window_turns_the_other_way() -> None:
    batch = flight_of(BLOCKED, BLOCKED, turning=1).window([0, 1])
    still = ControlAugmentConfig(mirror=1.0, gain=0.0, tint=0.0, exposure=0.0, noise=0.0)
    turned = augmented(batch, np.random.default_rng(0), still)
    assert (turned.frames == batch.frames[..., ::-1, :]).all()
    assert (turned.labels[:, 1] == -batch.labels[:, 1]).all()
    assert (turned.labels[:, [0, 2, 3]] == batch.labels[:, [0, 2, 3]]).all()
    assert (turned.turning == -1.0).all()
    assert (turned.state[:, 2] == -1.0).all()


def test_other_light_changes_pictures_and_nothing_else() -> None:
    batch = flight_of(BLOCKED, FREE).window([0, 1])
    relit = augmented(batch, np.random.default_rng(0), ControlAugmentConfig(mirror=0.0))
    assert (relit.labels == batch.labels).all()
    assert (relit.state == batch.state).all()
    assert 1.0 < np.abs(relit.frames.astype(int) - batch.frames).mean() < 60.0
