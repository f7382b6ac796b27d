"""The panes of the camera image and of the readings."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.uav_bt.display.display_world import CAMERA, World, has, shown_of
from uav_bt.board import MARK
from uav_bt.display.canvas import ACCENT, ALARM, shortened, text_width_px
from uav_bt.display.phrases import describe_movement
from uav_bt.display.video.panes import draw_camera, draw_readings, pad_circle, project_fix
from uav_bt.display.video.perception_panes import draw_class_map
from uav_bt.mission.safety import Override
from uav_bt.testing import blank_frame
from uav_bt.types import Command, Frame, MarkFix, Velocity

PANE_PX = (638, 359)


def frame_of(world: World, **changes: float) -> Frame:
    state = replace(world.tick().observation.state, **changes)
    return blank_frame(CAMERA, state)


DOWN = -math.pi / 2


@pytest.mark.parametrize(
    ("forward_m", "right_m", "mark_height_m", "pitch_rad", "expected"),
    [
        (0.15, 0.0, 0.4, DOWN, (0.0, 0.0, 1.1)),
        (0.15, 0.0, 0.05, DOWN, (0.0, 0.0, 1.45)),
        (2.15, 0.7, 0.4, 0.0, (0.7, 1.1, 2.0)),
    ],
    ids=["a pad below", "a mat below", "a pad ahead of a level lens"],
)
def test_a_mark_lies_in_the_camera_where_position_and_height_say(
    forward_m: float,
    right_m: float,
    mark_height_m: float,
    pitch_rad: float,
    expected: tuple[float, float, float],
) -> None:
    place = {"forward_m": forward_m, "right_m": right_m, "height_m": mark_height_m}
    fix = MarkFix(captured_s=0.0, detected=True, **place)
    frame = frame_of(World(), gimbal_pitch_rad=pitch_rad, height_above_ground_m=1.5)
    assert project_fix(fix, frame, CAMERA) == pytest.approx(expected)


@pytest.mark.parametrize("forward_m", [-2.0, 0.1])
def test_a_mark_behind_or_below_the_lens_has_no_ring(forward_m: float) -> None:
    fix = MarkFix(captured_s=0.0, forward_m=forward_m, right_m=0.0, height_m=0.4, detected=True)
    assert pad_circle(fix, frame_of(World(), gimbal_pitch_rad=0.0), CAMERA) is None


def test_a_pad_in_view_is_ringed_where_it_appears() -> None:
    world = World()
    fix = MarkFix(captured_s=0.0, forward_m=2.4, right_m=0.4, height_m=0.4, detected=True)
    world.board.write(MARK, fix)
    image = draw_camera(shown_of(world, world.tick(feedback="")), CAMERA, PANE_PX)
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
    image = draw_camera(shown_of(world, world.tick(feedback="")), CAMERA, PANE_PX)
    columns = np.nonzero((image == np.array(ACCENT, dtype=np.uint8)).all(axis=2))[1]
    assert columns.size
    assert (columns > PANE_PX[0] / 2).all() == (side == "right")


def test_the_feedback_of_the_running_leaf_is_written_on_the_image() -> None:
    world = World()
    silent = draw_camera(shown_of(world, world.tick(feedback="")), CAMERA, PANE_PX)
    spoken = draw_camera(shown_of(world, world.tick(feedback="obstacle")), CAMERA, PANE_PX)
    assert not has(silent, ACCENT)
    assert has(spoken, ACCENT)


def test_before_the_first_frame_the_panes_say_so() -> None:
    world = World()
    now = shown_of(world, world.tick(frame=False))
    for image in (draw_camera(now, CAMERA, PANE_PX), draw_class_map(None, PANE_PX)):
        assert image.shape == (359, 638, 3)
        assert len(np.unique(image.reshape(-1, 3), axis=0)) > 1, "a text"


def test_an_override_is_written_in_the_colour_of_alarm() -> None:
    world = World()
    calm = draw_readings(shown_of(world, world.tick()), (638, 279))
    alarmed = draw_readings(shown_of(world, world.tick(override=Override.BATTERY)), (638, 279))
    assert not has(calm, ALARM)
    assert has(alarmed, ALARM)


def test_a_branch_deeper_than_the_pane_shows_its_lower_end() -> None:
    world = World()
    deep = tuple(f"node_{depth}" for depth in range(40))
    image = draw_readings(shown_of(world, world.tick(active=deep)), (638, 279))
    assert has(image[70:], ACCENT), "the leaf"


def test_what_is_longer_than_its_column_is_cut_with_dots() -> None:
    world, size_px = World(), (638, 279)
    long = Velocity(forward_mps=0.6, right_mps=0.25, down_mps=-0.1, yaw_rate_radps=0.5)
    record = world.tick(active=("Sequence", "A leaf " * 12))
    record = replace(record, command=Command(movement=long))
    image = draw_readings(shown_of(world, record), size_px)
    panel = image[270, 5]
    assert (image[60:, -17:] == panel).all()  # the right margin
    assert (image[60:, 301:307] == panel).all()  # between the columns
    words = describe_movement(long)
    cut = shortened(words, 200, 0.45)
    assert cut.endswith("...")
    assert words.startswith(cut.removesuffix("..."))
    assert 170 < text_width_px(cut, 0.45) <= 200
    assert shortened(words, 2000, 0.45) == words
