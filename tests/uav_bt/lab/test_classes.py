"""Classes of a lab: ids, roles, tops and colours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from uav_bt.errors import UnknownNameError, ValueRangeError
from uav_bt.lab.classes import (
    GROUND,
    MARK,
    MAX_CLASSES,
    OBSTACLE,
    OUTSIDE,
    LabClass,
    LabClasses,
    RoleName,
)
from uav_bt.lab.shipped import load_lab

PAPER = load_lab("paper").classes


def a_class(name: str, role: RoleName, top: str | None = None) -> LabClass:
    return LabClass(name=name, role=role, colour=(1, 2, 3), top=top)


def on_legs(name: str, role: RoleName, legs_m: float) -> LabClass:
    return replace(a_class(name, role), legs_m=legs_m)


WALL = a_class("wall", "outside")


def test_ids_beyond_the_classes_or_of_another_type_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="must be 0 to 16, got 17"):
        PAPER.roles(np.array([[3, 17]], dtype=np.uint8))
    with pytest.raises(ValueRangeError, match="uint8"):
        PAPER.roles(np.array([1], dtype=np.int64))  # type: ignore[arg-type]
    with pytest.raises(UnknownNameError, match="did you mean 'helipad_box'"):
        PAPER.id_of("helipad_bx")
    with pytest.raises(ValueRangeError, match="no class has the role ground"):
        _ = LabClasses([WALL]).ground


def test_the_order_of_the_classes_is_free_behind_the_first_one() -> None:
    classes = LabClasses(
        [WALL, a_class("tag", "mark"), a_class("drum", "obstacle"), a_class("floor", "ground")]
    )
    ids = np.array([0, 1, 2, 3], dtype=np.uint8)
    assert classes.roles(ids).tolist() == [OUTSIDE, MARK, OBSTACLE, GROUND]
    assert (classes.ground, classes.mark_sides, classes.mark_top) == (3, None, 1)


def test_several_ground_classes_become_the_first_one() -> None:
    classes = LabClasses([WALL, a_class("rug", "ground"), a_class("tiles", "ground")])
    ids = np.array([[0, 1, 2]], dtype=np.uint8)
    assert classes.with_one_ground(ids).tolist() == [[0, 1, 1]]
    assert PAPER.with_one_ground(ids) is ids


@pytest.mark.parametrize(
    ("classes", "message"),
    [
        ([], "expected 1 to 64 classes, got 0"),
        ([WALL] + [a_class(f"c{k}", "ground") for k in range(MAX_CLASSES)], "got 65"),
        ([WALL, WALL], "'wall' is listed twice"),
        ([a_class("floor", "ground")], "'floor' has the role ground"),
        ([WALL, a_class("box", "obstacle", "lid"), a_class("lid", "ground")], "same role"),
        ([WALL, a_class("box", "obstacle", "box")], "same role"),
        ([WALL, a_class("box", "obstacle", "lid")], "unknown class 'lid'"),
        ([WALL, on_legs("floor", "ground", 1.0)], "cannot stand on legs"),
        (
            [WALL, a_class("box", "obstacle", "lid"), on_legs("lid", "obstacle", 1.0)],
            "'lid' cannot stand on legs",
        ),
    ],
)
def test_classes_that_make_no_lab_are_refused(classes: list[LabClass], message: str) -> None:
    with pytest.raises((ValueRangeError, UnknownNameError), match=message):
        LabClasses(classes)
