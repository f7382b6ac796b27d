"""The pane of the class map and its legend."""

import numpy as np
import pytest

from tests.uav_bt.display.display_world import COLOURS, PALETTE
from uav_bt.display.canvas import ALARM
from uav_bt.display.video.class_pane import ClassPalette, draw_class_map
from uav_bt.errors import ShapeError
from uav_bt.types import ClassMap

PANE_PX = (638, 359)


def class_map(*ids: int) -> ClassMap:
    """Return a map with a vertical stripe of each class."""
    stripes = np.repeat(np.array(ids, dtype=np.uint8), 8)
    return ClassMap(ids=np.tile(stripes, (28, 1)), captured_s=0.0)


def bright(image: np.ndarray, rows: slice) -> int:
    """Return the number of pixels in some rows that are lighter than all classes of the palette."""
    return int((image[rows].min(axis=2) > 150).sum())


def test_classes_are_drawn_in_their_colours_and_unknown_ones_stand_out() -> None:
    image = draw_class_map(class_map(5, 99), PALETTE, PANE_PX)
    assert tuple(image[200, 100]) == tuple(COLOURS[5])
    assert tuple(image[200, 600]) == ALARM


def test_the_legend_has_the_classes_that_are_in_view_and_no_others() -> None:
    entries = PALETTE.entries(class_map(9, 2, 2).ids)
    assert entries == [("class 2", tuple(COLOURS[2])), ("class 9", tuple(COLOURS[9]))]


def test_ids_without_a_class_are_one_entry_in_the_colour_they_are_drawn_in() -> None:
    assert PALETTE.entries(class_map(0, 99, 100).ids)[1:] == [("unknown", ALARM)]


def test_a_few_pixels_of_a_class_are_no_entry() -> None:
    ids = np.full((100, 100), 3, dtype=np.uint8)
    ids[0, :5] = 7
    assert [name for name, _ in PALETTE.entries(ids)] == ["class 3"]


def test_swatches_are_drawn_in_the_colours_of_their_classes() -> None:
    colours = np.array([(10, 10, 10), (200, 30, 30)], dtype=np.uint8)
    palette = ClassPalette(names=("ground", "drum"), colours=colours)
    ids = np.zeros((100, 100), dtype=np.uint8)
    ids[90:, 90:] = 1
    legend = draw_class_map(ClassMap(ids=ids, captured_s=0.0), palette, PANE_PX)[10:50]
    assert (legend == colours[1]).all(axis=2).sum() >= 40


@pytest.mark.parametrize("size_px", [PANE_PX, (318, 178)])
def test_however_many_classes_are_in_view_the_legend_leaves_the_ground_free(
    size_px: tuple[int, int],
) -> None:
    image = draw_class_map(class_map(*range(17)), PALETTE, size_px)
    assert bright(image, slice(10, 30)) > 100
    assert bright(image, slice(30, 50)) > 100
    assert bright(image, slice(50, None)) == 0
    assert bright(image[:, -10:], slice(None)) == 0


@pytest.mark.parametrize("shape", [(17, 4), (16, 3)])
def test_colours_that_do_not_match_the_names_are_refused(shape: tuple[int, int]) -> None:
    with pytest.raises(ShapeError, match="class colours must be 17x3, got"):
        ClassPalette(names=PALETTE.names, colours=np.zeros(shape, dtype=np.uint8))
