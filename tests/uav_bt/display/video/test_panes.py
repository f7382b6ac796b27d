"""The panes of films: camera image, readings, class map, depth and corridor."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.paper_lab import CLASSES, paper_map
from tests.uav_bt.display.display_world import CAMERA, World, has, shown_of
from tests.worlds import values
from uav_bt.board import MARK
from uav_bt.display.canvas import ACCENT, ALARM, PANEL, shortened, text_width_px
from uav_bt.display.phrases import describe_movement
from uav_bt.display.video import panes
from uav_bt.mission.safety import Override
from uav_bt.testing import blank_frame
from uav_bt.types import ClassMap, Command, DepthMap, Frame, MarkFix, Velocity

PANE_PX = (638, 359)
SMALL_PX = (318, 178)
DOWN = -math.pi / 2


def frame_of(world: World, **changes: float) -> Frame:
    state = replace(world.tick().observation.state, **changes)
    return blank_frame(CAMERA, state)


def mark(forward_m: float, right_m: float = 0.0, height_m: float = 0.4) -> MarkFix:
    place = {"forward_m": forward_m, "right_m": right_m, "height_m": height_m}
    return MarkFix(captured_s=0.0, detected=True, **place)


def accents(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of the pixels in the colour of the mark."""
    return np.nonzero((image == np.array(ACCENT, dtype=np.uint8)).all(axis=2))


@pytest.mark.parametrize(
    ("fix", "pitch_rad", "expected"),
    [
        (mark(0.15), DOWN, (0.0, 0.0, 1.1)),
        (mark(0.15, height_m=0.05), DOWN, (0.0, 0.0, 1.45)),
        (mark(2.15, 0.7), 0.0, (0.7, 1.1, 2.0)),
    ],
    ids=["a pad below", "a mat below", "a pad ahead of a level lens"],
)
def test_a_mark_lies_in_the_camera_where_position_and_height_say(
    fix: MarkFix, pitch_rad: float, expected: tuple[float, float, float]
) -> None:
    frame = frame_of(World(), gimbal_pitch_rad=pitch_rad, height_above_ground_m=1.5)
    assert panes.project_fix(fix, frame, CAMERA) == pytest.approx(expected)


def seen_with(fix: MarkFix) -> tuple[World, np.ndarray]:
    world = World()
    world.board.write(MARK, fix)
    return world, panes.draw_camera(shown_of(world, world.tick(feedback="")), CAMERA, PANE_PX)


def test_a_pad_in_view_is_ringed_where_it_appears() -> None:
    fix = mark(2.4, 0.4)
    world, image = seen_with(fix)
    rows, columns = accents(image)
    right_m, down_m, depth_m = panes.project_fix(fix, frame_of(world), CAMERA)
    lens = CAMERA.resized(*PANE_PX)
    middle = lens.cx_px + lens.fx_px * right_m / depth_m
    low = lens.cy_px + lens.fy_px * (down_m + 0.3) / depth_m
    assert (columns.min() + columns.max()) / 2 == pytest.approx(middle, abs=4)
    assert rows.max() == pytest.approx(low, abs=12)


@pytest.mark.parametrize(
    ("fix", "axis", "is_beyond"),
    [(mark(-1.0, 3.0), 1, True), (mark(-1.0, -3.0), 1, False), (mark(0.1), 0, True)],
    ids=["right", "left", "below the lens"],
)
def test_a_pad_out_of_view_is_pointed_at(fix: MarkFix, axis: int, *, is_beyond: bool) -> None:
    places = accents(seen_with(fix)[1])[axis]
    assert places.size
    assert (places > PANE_PX[1 - axis] / 2).all() == is_beyond


@pytest.mark.parametrize("override", [None, Override.BATTERY])
def test_an_override_is_written_in_the_colour_of_alarm(override: Override | None) -> None:
    world = World()
    image = panes.draw_readings(shown_of(world, world.tick(override=override)), (638, 279))
    assert has(image, ALARM) == (override is not None)


def test_what_is_longer_than_its_column_is_cut_with_dots() -> None:
    world, size_px = World(), (638, 279)
    long = Velocity(forward_mps=0.6, right_mps=0.25, down_mps=-0.1, yaw_rate_radps=0.5)
    record = world.tick(active=("Sequence", "A leaf " * 12))
    record = replace(record, command=Command(movement=long))
    image = panes.draw_readings(shown_of(world, record), size_px)
    panel = image[270, 5]
    assert (image[60:, -17:] == panel).all()  # the right margin
    assert (image[60:, 301:307] == panel).all()  # between the columns
    words = describe_movement(long)
    cut = shortened(words, 200, 0.45)
    assert cut.endswith("...")
    assert words.startswith(cut.removesuffix("..."))
    assert 170 < text_width_px(cut, 0.45) <= 200
    assert shortened(words, 2000, 0.45) == words


GREY = values.frame(np.full((36, 64, 3), 100, np.uint8), captured_s=0.0)


def depth_map(value: float, unknown: slice | None = None) -> DepthMap:
    depth = np.full((28, 56), value, np.float32)
    if unknown is not None:
        depth[:, unknown] = np.nan
    return DepthMap(depth=depth, metric=True, captured_s=0.0, confidence=0.8)


INTRUDED = replace(values.corridor(1.2, "left", nearest_m=0.7), nearest_left_m=0.7)


def class_map(*ids: int) -> ClassMap:
    """Return a map with a vertical stripe of each class."""
    stripes = np.repeat(np.array(ids, dtype=np.uint8), 8)
    return paper_map(ids=np.tile(stripes, (28, 1)), captured_s=0.0)


def test_the_legend_has_the_classes_that_are_in_view_and_no_others() -> None:
    assert [name for name, _ in panes.legend_of(class_map(9, 2, 2))] == ["helipad h", "box 6"]
    ids = np.full((100, 100), 3, dtype=np.uint8)
    ids[0, :5] = 7  # a few pixels are no entry
    assert [name for name, _ in panes.legend_of(paper_map(ids))] == ["helipad box"]


@pytest.mark.parametrize("size_px", [PANE_PX, SMALL_PX])
def test_a_legend_of_many_classes_leaves_the_ground_free(size_px: tuple[int, int]) -> None:
    dark = [each for each in range(17) if CLASSES.colours[each].min() < 150]
    bright = panes.draw_class_map(class_map(*dark), size_px).min(axis=2) > 150
    assert bright[10:30].sum() > 100
    assert bright[30:50].sum() > 100
    assert bright[50:].sum() == 0


def test_near_is_red_far_is_blue_as_on_the_bar_and_unknown_is_grey() -> None:
    def shown(metres: float, unknown: slice | None = None) -> np.ndarray:
        return panes.draw_depth(depth_map(metres, unknown), PANE_PX).astype(int)

    near, far, at_end, beyond = (shown(metres)[200, 100] for metres in (0.6, 4.4, 5.0, 19.0))
    assert near[0] > near[2] + 80
    assert far[2] > far[0] + 80
    assert np.ptp(shown(0.6, slice(0, 28))[200, 100]) < 20
    assert (at_end == beyond).all()
    image, bottom, top = shown(2.0), PANE_PX[1] - 14, 34
    bar = image[top:bottom, PANE_PX[0] - 40]
    same = np.flatnonzero(np.abs(bar - image[200, 100]).sum(axis=1) < 12)
    assert same.size
    assert 5.0 * (1.0 - same.mean() / (bottom - top)) == pytest.approx(2.0, abs=0.1)


def test_without_depth_the_pane_says_why_within_its_size() -> None:
    told = panes.draw_depth(None, SMALL_PX, why_none="the class map is of another frame")
    assert len(np.unique(told[:, 4:-4])) > 2, "a text"
    assert (told[:, :4] == PANEL).all()
    assert (told[:, -4:] == PANEL).all()
    assert not has(panes.draw_depth(depth_map(2.0, slice(None)), PANE_PX), ALARM), "nothing known"
    assert has(
        panes.draw_depth(depth_map(2.0), PANE_PX, why_none="no scale: too little ground"), ALARM
    )


def test_what_intrudes_is_marked_and_nothing_else() -> None:
    marked = np.zeros((28, 56), dtype=bool)
    marked[10:20, 30:40] = True
    image = panes.draw_corridor(GREY, INTRUDED, marked, PANE_PX).astype(int)
    inside, outside = image[200, 400], image[250, 100]
    assert inside[0] > inside[2] + 40
    assert tuple(outside) == (50, 50, 50), "darkened"
    clear = values.corridor()
    assert not has(panes.draw_corridor(GREY, clear, None, PANE_PX), ALARM)
    assert has(panes.draw_corridor(GREY, INTRUDED, None, PANE_PX), ALARM), "the words"


def test_rows_tell_the_age_of_depth_and_what_is_unknown() -> None:
    world = World()
    assert panes.corridor_rows(shown_of(world, world.tick())) == []
    world.see_depth()
    rows = {name: value for name, value, _ in panes.corridor_rows(shown_of(world, world.tick()))}
    assert rows == {"depth": "0.1 s old, confidence 1.00", "unknown": "0 pixels of objects"}


def test_what_was_perceived_of_an_image_makes_a_picture_of_four_panes() -> None:
    drawn, ids = panes.PerceptionPanes(CAMERA), np.full((28, 56), 5, np.uint8)
    nothing = panes.Seen(
        frame=GREY,
        class_map=paper_map(ids=ids, captured_s=0.0),
        depth=None,
        refusal="the frame is black",
        corridor=None,
        intruding=None,
        mark=None,
    )
    image = drawn.draw(nothing)
    assert drawn.size_px == (1280, 720)
    assert image.shape == (720, 1280, 3)
    assert tuple(image[100, 300]) == (100, 100, 100), "the image"
    assert tuple(image[600, 300]) == tuple(CLASSES.colours[5]), "the class map"
    assert tuple(image[30, 1000]) == PANEL, "no depth"
    assert tuple(image[700, 1000]) == PANEL, "no corridor"
    image = drawn.draw(replace(nothing, depth=depth_map(1.0), refusal="", mark=mark(2.0)))
    assert tuple(image[100, 900]) != PANEL
    assert len(accents(image[:360, :640])[0]) > 100, "a ring"
    square = replace(CAMERA, width_px=64, height_px=64)
    assert panes.PerceptionPanes(square).size_px == (1280, 1280), "the aspect of the lens"
