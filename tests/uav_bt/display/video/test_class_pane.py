"""The pane of the class map and its legend."""

import numpy as np
import pytest

from tests.paper_lab import CLASSES, paper_map
from uav_bt.display.video.class_pane import _entries, draw_class_map
from uav_bt.lab.classes import LabClass, LabClasses
from uav_bt.types import ClassMap

PANE_PX = (638, 359)


def class_map(*ids: int) -> ClassMap:
    """Return a map with a vertical stripe of each class."""
    stripes = np.repeat(np.array(ids, dtype=np.uint8), 8)
    return paper_map(ids=np.tile(stripes, (28, 1)), captured_s=0.0)


def bright(image: np.ndarray, rows: slice) -> int:
    """Return the number of pixels in some rows that are lighter than all classes of the palette."""
    return int((image[rows].min(axis=2) > 150).sum())


def test_classes_are_drawn_in_their_colours() -> None:
    image = draw_class_map(class_map(5, 7), PANE_PX)
    assert tuple(image[200, 100]) == tuple(CLASSES.colours[5])
    assert tuple(image[200, 600]) == tuple(CLASSES.colours[7])


def test_the_legend_has_the_classes_that_are_in_view_and_no_others() -> None:
    assert [name for name, _ in _entries(class_map(9, 2, 2))] == ["helipad h", "box 6"]


def test_a_few_pixels_of_a_class_are_no_entry() -> None:
    ids = np.full((100, 100), 3, dtype=np.uint8)
    ids[0, :5] = 7
    assert [name for name, _ in _entries(paper_map(ids))] == ["helipad box"]


def test_swatches_are_drawn_in_the_colours_of_their_classes() -> None:
    hall = LabClasses(
        [
            LabClass(name="wall", role="outside", colour=(10, 10, 10)),
            LabClass(name="drum", role="obstacle", colour=(200, 30, 30)),
        ]
    )
    ids = np.zeros((100, 100), dtype=np.uint8)
    ids[90:, 90:] = 1
    seen = ClassMap(ids=ids, classes=hall, captured_s=0.0)
    legend = draw_class_map(seen, PANE_PX)[10:50]
    assert (legend == hall.colours[1]).all(axis=2).sum() >= 40


@pytest.mark.parametrize("size_px", [PANE_PX, (318, 178)])
def test_however_many_classes_are_in_view_the_legend_leaves_the_ground_free(
    size_px: tuple[int, int],
) -> None:
    dark = [each for each in range(17) if CLASSES.colours[each].min() < 150]
    image = draw_class_map(class_map(*dark), size_px)
    assert bright(image, slice(10, 30)) > 100
    assert bright(image, slice(30, 50)) > 100
    assert bright(image, slice(50, None)) == 0
    assert bright(image[:, -10:], slice(None)) == 0
