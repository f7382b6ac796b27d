"""The map: conversion of world metres to pixels, and drawing."""

import math

import numpy as np
import pytest

from tests.uav_bt.display.display_world import LAB, World
from uav_bt.display.flown_path import FlownPath
from uav_bt.display.lab_map import (
    LabMap,
    MapFrame,
    MapItem,
    draw_lab,
    draw_legend,
    phase_colours,
)
from uav_bt.errors import ValueRangeError
from uav_bt.types import Pose


def test_the_origin_lies_in_the_middle_x_goes_right_and_y_goes_up() -> None:
    frame = MapFrame(size_px=(640, 440), scale_px_per_m=100.0)
    assert frame.to_px(0.0, 0.0) == (320.0, 220.0)
    assert frame.to_px(1.0, 0.0) == (420.0, 220.0)
    assert frame.to_px(0.0, 1.5) == (320.0, 70.0)


@pytest.mark.parametrize(("size_px", "scale"), [((600, 1000), 100.0), ((1000, 500), 100.0)])
def test_the_ground_and_its_margin_fill_the_narrower_side(
    size_px: tuple[int, int], scale: float
) -> None:
    frame = MapFrame.around((5.0, 4.0), size_px, margin_m=0.5)
    assert frame.scale_px_per_m == pytest.approx(scale)


def test_a_frame_without_pixels_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="cannot show"):
        MapFrame.around((5.0, 4.0), (0, 100))


def test_a_ground_without_a_size_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="must have a size"):
        LabMap(ground_size_m=(5.0, 0.0))


def test_a_turned_box_has_its_corners_turned_counter_clockwise() -> None:
    box = MapItem(x_m=1.0, y_m=2.0, size_m=(2.0, 4.0, 1.0), yaw_rad=math.pi / 2)
    expected = [(-1.0, 3.0), (-1.0, 1.0), (3.0, 1.0), (3.0, 3.0)]
    assert np.allclose(box.corners(), expected)


def test_boxes_and_the_mark_stand_where_the_world_has_them() -> None:
    frame = MapFrame.around(LAB.ground_size_m, (640, 440))
    image = draw_lab(LAB, frame)
    box = LAB.boxes[0]
    x, y = (round(v) for v in frame.to_px(box.x_m - 0.15, box.y_m + 0.15))
    assert tuple(image[y, x]) == box.colour
    x, y = (round(v) for v in frame.to_px(box.x_m - 0.15, -box.y_m + 0.15))
    assert tuple(image[y, x]) != box.colour, "mirrored"
    pad = LAB.mark
    x, y = (round(v) for v in frame.to_px(pad.x_m, pad.y_m))
    assert tuple(image[y, x]) == (255, 255, 255), "the bar of the H"


def test_an_unknown_lab_is_a_grid() -> None:
    frame = MapFrame.around((6.0, 6.0), (300, 300))
    assert len(np.unique(draw_lab(None, frame).reshape(-1, 3), axis=0)) > 1


def test_phases_get_colours_of_their_own_in_the_order_they_appear() -> None:
    colours = phase_colours(["", "explore", "explore", "search", "land"])
    assert list(colours) == ["", "explore", "search", "land"]
    assert len(set(colours.values())) == 4
    assert phase_colours(["explore"])["explore"] == colours["explore"]


def test_with_a_referee_the_path_is_the_true_one() -> None:
    world, flown = World(), FlownPath()
    for x in (0.0, 0.3, 0.6):
        flown.add(world.tick(pose=Pose(x_m=x, y_m=1.0, z_m=1.5, yaw_rad=0.2), forward_mps=9.0))
    assert [(point.x_m, point.y_m) for point in flown.points] == [(0, 1), (0.3, 1), (0.6, 1)]
    assert flown.distance_m == pytest.approx(0.6)
    assert flown.pose == Pose(x_m=0.6, y_m=1.0, z_m=1.5, yaw_rad=0.2)


def test_without_one_the_telemetry_is_added_up_from_where_it_looked_first() -> None:
    world, flown = World(), FlownPath()
    flown.add(world.tick(yaw_rad=1.0, forward_mps=2.0))
    flown.add(world.tick(yaw_rad=1.0, forward_mps=2.0))
    # Between two ticks it flies at their mean speed and mean heading. The drone's yaw is
    # clockwise: an eighth of a turn to the right is towards the world's -y.
    pose = flown.add(world.tick(yaw_rad=1.0 + math.pi / 2, forward_mps=0.0))
    eighth_m = 0.1 * math.sqrt(0.5)
    assert (pose.x_m, pose.y_m) == (pytest.approx(0.2 + eighth_m), pytest.approx(-eighth_m))
    assert pose.yaw_rad == pytest.approx(-math.pi / 2)
    assert flown.distance_m == pytest.approx(0.3)


def test_a_legend_that_is_too_long_keeps_its_last_phases() -> None:
    def legend(phases: list[str]) -> np.ndarray:
        image = np.zeros((30, 300, 3), dtype=np.uint8)
        draw_legend(image, phase_colours(phases), base_px=20)
        return image

    many = [f"phase {number}" for number in range(7)]
    assert (legend(many)[:, 290:] == 0).all()
    last = phase_colours(many)["phase 6"]
    assert (legend(many) == np.array(last)).all(axis=2).any()
