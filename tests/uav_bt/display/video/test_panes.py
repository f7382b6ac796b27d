"""The panes of the camera image and of the readings."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.uav_bt.display.display_world import CAMERA, World
from uav_bt.board import CLASS_MAP, MARK
from uav_bt.display.canvas import ACCENT, ALARM, shortened, text_width_px
from uav_bt.display.phrases import describe_movement
from uav_bt.display.video.class_pane import draw_class_map
from uav_bt.display.video.panes import (
    Readings,
    draw_camera,
    draw_readings,
    project_fix,
)
from uav_bt.mission.safety import Override
from uav_bt.mission.tick import TickRecord
from uav_bt.testing import blank_frame
from uav_bt.types import Command, Frame, MarkFix, Velocity

PANE_PX = (638, 359)


def readings(world: World, record: TickRecord) -> Readings:
    return Readings(
        record=record,
        fix=world.board.read(MARK),
        class_map=world.board.read(CLASS_MAP),
        elapsed_s=12.3,
        distance_m=4.5,
    )


def frame_of(world: World, **changes: float) -> Frame:
    state = replace(world.tick().observation.state, **changes)
    return blank_frame(CAMERA, state)


def has(image: NDArray[np.uint8], colour: int | tuple[int, int, int]) -> bool:
    return bool((image == np.array(colour, dtype=np.uint8)).all(axis=2).any())


def test_a_pad_straight_below_lies_on_the_axis_of_a_lens_that_looks_down() -> None:
    fix = MarkFix(captured_s=0.0, forward_m=0.15, right_m=0.0, height_m=0.4, detected=True)
    frame = frame_of(World(), gimbal_pitch_rad=-math.pi / 2, height_above_ground_m=1.5)
    assert project_fix(fix, frame, CAMERA) == pytest.approx((0.0, 0.0, 1.1))


def test_a_mat_lies_where_its_height_says() -> None:
    mat = MarkFix(captured_s=0.0, forward_m=0.15, right_m=0.0, detected=True, height_m=0.05)
    frame = frame_of(World(), gimbal_pitch_rad=-math.pi / 2, height_above_ground_m=1.5)
    assert project_fix(mat, frame, CAMERA) == pytest.approx((0.0, 0.0, 1.45))


def test_a_level_lens_has_a_pad_ahead_below_its_axis() -> None:
    fix = MarkFix(captured_s=0.0, forward_m=2.15, right_m=0.7, height_m=0.4, detected=True)
    frame = frame_of(World(), gimbal_pitch_rad=0.0, height_above_ground_m=1.5)
    assert project_fix(fix, frame, CAMERA) == pytest.approx((0.7, 1.1, 2.0))


def test_a_pad_in_view_is_ringed_where_it_appears() -> None:
    world = World()
    fix = MarkFix(captured_s=0.0, forward_m=2.4, right_m=0.4, height_m=0.4, detected=True)
    world.board.write(MARK, fix)
    image = draw_camera(readings(world, world.tick(feedback="")), CAMERA, PANE_PX)
    rows, columns = np.nonzero((image == np.array(ACCENT, dtype=np.uint8)).all(axis=2))
    right_m, down_m, depth_m = project_fix(fix, frame_of(world), CAMERA)
    shown = CAMERA.resized(*PANE_PX)
    assert (columns.min() + columns.max()) / 2 == pytest.approx(
        shown.cx_px + shown.fx_px * right_m / depth_m, abs=4
    )
    assert rows.max() == pytest.approx(shown.cy_px + shown.fy_px * (down_m + 0.3) / depth_m, abs=12)


@pytest.mark.parametrize(("right_m", "side"), [(3.0, "right"), (-3.0, "left")])
def test_a_pad_out_of_view_is_pointed_at_from_the_edge(right_m: float, side: str) -> None:
    world = World()
    fix = MarkFix(captured_s=0.0, forward_m=-1.0, right_m=right_m, height_m=0.4, detected=True)
    world.board.write(MARK, fix)
    image = draw_camera(readings(world, world.tick(feedback="")), CAMERA, PANE_PX)
    columns = np.nonzero((image == np.array(ACCENT, dtype=np.uint8)).all(axis=2))[1]
    assert columns.size
    assert (columns > PANE_PX[0] / 2).all() == (side == "right")


def test_the_feedback_of_the_running_leaf_is_written_on_the_image() -> None:
    world = World()
    silent = draw_camera(readings(world, world.tick(feedback="")), CAMERA, PANE_PX)
    spoken = draw_camera(readings(world, world.tick(feedback="obstacle")), CAMERA, PANE_PX)
    assert not has(silent, ACCENT)
    assert has(spoken, ACCENT)


def test_before_the_first_frame_the_panes_say_so() -> None:
    world = World()
    now = readings(world, world.tick(frame=False))
    for image in (draw_camera(now, CAMERA, PANE_PX), draw_class_map(None, PANE_PX)):
        assert image.shape == (359, 638, 3)
        assert len(np.unique(image.reshape(-1, 3), axis=0)) > 1, "a text"


def test_an_override_is_written_in_the_colour_of_alarm() -> None:
    world = World()
    calm = draw_readings(readings(world, world.tick()), (638, 279))
    alarmed = draw_readings(readings(world, world.tick(override=Override.BATTERY)), (638, 279))
    assert not has(calm, ALARM)
    assert has(alarmed, ALARM)


def test_a_branch_deeper_than_the_pane_shows_its_lower_end() -> None:
    world = World()
    deep = tuple(f"node_{depth}" for depth in range(40))
    image = draw_readings(readings(world, world.tick(active=deep)), (638, 279))
    assert has(image[70:], ACCENT), "the leaf"


def test_what_is_longer_than_its_column_is_cut_with_dots() -> None:
    world, size_px = World(), (638, 279)
    long = Velocity(forward_mps=0.6, right_mps=0.25, down_mps=-0.1, yaw_rate_radps=0.5)
    record = world.tick(active=("Sequence", "A leaf " * 12))
    record = replace(record, command=Command(movement=long))
    image = draw_readings(readings(world, record), size_px)
    panel = image[270, 5]
    assert (image[60:, -17:] == panel).all()  # the right margin
    assert (image[60:, 301:307] == panel).all()  # between the columns
    words = describe_movement(long)
    cut = shortened(words, 200, 0.45)
    assert cut.endswith("...")
    assert words.startswith(cut.removesuffix("..."))
    assert 170 < text_width_px(cut, 0.45) <= 200
    assert shortened(words, 2000, 0.45) == words
