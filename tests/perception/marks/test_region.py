"""A region of one class as landing mark: its place at any height, and regions that are refused."""

import math
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from perception.marks.region import RegionFinder
from tests.paper_lab import paper_map
from tests.perception.marks.tag_views import CAMERA, tag_mark, view_of_classes
from uav_bt.errors import InputError
from uav_bt.lab.shipped import load_lab
from uav_bt.landing_marks import MarkSighting
from uav_bt.types import ClassMap, LandingMark
from uav_bt.types.projection import project

SIZE_PX = (224, 112)
CLASSES = load_lab().classes
TOP = CLASSES.id_of("helipad_h")
CAMERA_M = 1.5


def mark(height_m: float = 0.2, options: dict[str, Any] | None = None) -> LandingMark:
    return tag_mark(kind="region", height_m=height_m, options=options or {})


def drawn(height_m: float, forward_m: float, pitch_deg: float, side_m: float = 0.5) -> ClassMap:
    """Return the class map of a square mark ahead of the lens."""
    half_m = side_m / 2.0
    square = [(-half_m, -half_m), (half_m, -half_m), (half_m, half_m), (-half_m, half_m)]
    corners = [(forward_m + x, y, CAMERA_M - height_m) for x, y in square]
    pixels = project(corners, CAMERA.resized(*SIZE_PX), math.radians(pitch_deg))
    ids: NDArray[np.uint8] = np.full(SIZE_PX[::-1], CLASSES.ground, dtype=np.uint8)
    cv2.fillPoly(ids, [np.round(pixels * 16).astype(np.int32)], TOP, shift=4)
    return paper_map(ids=ids, captured_s=0.0)


def seen(
    class_map: ClassMap | None, pitch_deg: float, *, of: LandingMark, camera_m: float = CAMERA_M
) -> MarkSighting | None:
    view = view_of_classes(class_map, CAMERA, pitch_deg=pitch_deg, height_m=camera_m)
    return RegionFinder(of).find(view)


@pytest.mark.parametrize("height_m", [0.0, 0.3, 0.6])
@pytest.mark.parametrize(
    ("forward_m", "pitch_deg"), [(0.0, -90.0), (1.0, -50.0), (2.0, -35.0), (3.5, -25.0)]
)
def test_the_place_at_any_height(height_m: float, forward_m: float, pitch_deg: float) -> None:
    found = seen(drawn(height_m, forward_m, pitch_deg), pitch_deg, of=mark(height_m))
    assert found.forward_m - CAMERA.forward_offset_m == pytest.approx(forward_m, abs=0.03)
    assert found.right_m == pytest.approx(0.0, abs=0.02)
    assert (found.height_m, found.heading_deg) == (height_m, None)
    assert found.confidence > 0.8


def test_a_cut_or_partial_region_is_trusted_less() -> None:
    """The whole mark, one that the border cuts, and half of the area."""
    for forward_m, side_m, least, most in (
        (0.0, 0.5, 0.9, 1.0),
        (0.45, 0.5, 0.2, 0.5),
        (0.0, 0.35, 0.45, 0.55),
    ):
        found = seen(drawn(0.2, forward_m, -90.0, side_m), -90.0, of=mark())
        assert least < found.confidence <= most


def test_specks_empty_views_and_unknown_heights_have_no_place() -> None:
    empty = paper_map(ids=np.zeros((112, 224), np.uint8), captured_s=0.0)
    for class_map in (drawn(0.2, 1.0, -45.0, side_m=0.1), empty, None):
        assert seen(class_map, -45.0, of=mark()) is None
    for camera_m in (math.nan, 0.1):
        assert seen(drawn(0.2, 1.0, -45.0), -45.0, of=mark(), camera_m=camera_m) is None


def test_the_class_is_one_of_the_lab_with_the_role_mark() -> None:
    view = drawn(0.2, 1.0, -45.0)
    assert seen(view, -45.0, of=mark(options={"class": "helipad_h"})) is not None
    with pytest.raises(InputError, match="unknown class with the role mark 'helipad'"):
        seen(view, -45.0, of=mark(options={"class": "helipad"}))
    with pytest.raises(InputError, match="no option 'size_m'"):
        RegionFinder(mark(options={"size_m": 0.3}))
