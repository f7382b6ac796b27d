"""The seventeen classes and their four groups."""

import numpy as np
import pytest

from uav_bt import classes
from uav_bt.errors import UnknownNameError, ValueRangeError


def test_there_are_seventeen_classes_with_unique_names_and_colours() -> None:
    assert classes.CLASS_COUNT == 17
    assert len(set(classes.CLASS_NAMES)) == 17
    assert len({tuple(colour) for colour in classes.CLASS_COLOURS.tolist()}) == 17


def test_every_class_falls_into_its_group() -> None:
    ids = np.arange(17, dtype=np.uint8)
    assert classes.group_of(ids).tolist() == [0, 1, 2, 2] + [3] * 13


def test_a_class_name_gives_its_id_and_a_typo_gets_a_suggestion() -> None:
    assert classes.class_id("roof_5") == 16
    with pytest.raises(UnknownNameError, match="did you mean 'helipad_box'"):
        classes.class_id("helipad_bx")


def test_an_id_beyond_the_seventeen_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="within 0 and 16, got 17"):
        classes.group_of(np.array([[3, 17]], dtype=np.uint8))


def test_ids_of_another_type_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="uint8"):
        classes.group_of(np.array([1], dtype=np.int64))  # type: ignore[arg-type]


def test_a_picture_shows_each_pixels_class_colour() -> None:
    ids = np.array([[0, 16]], dtype=np.uint8)
    picture = classes.colourise(ids)
    assert picture.shape == (1, 2, 3)
    assert picture[0, 1].tolist() == classes.CLASS_COLOURS[16].tolist()
