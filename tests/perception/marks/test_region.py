"""Marks of another kind: the region of a class, and a spot without a mark."""

import math
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from perception.marks.region import RegionFinder
from perception.marks.spot import SpotFinder
from tests.paper_lab import paper_map
from tests.perception.marks.mark_views import (
    AT_THE_SPOT,
    SIDE_PX,
    TAG_CAMERA,
    ground_view,
    tag_mark,
    texture,
    view_of_classes,
)
from uav_bt.errors import InputError
from uav_bt.lab.shipped import load_lab
from uav_bt.landing_marks import MarkSighting
from uav_bt.types import ClassMap, LandingMark, Pose2D
from uav_bt.types.arrays import Image
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
    pixels = project(corners, TAG_CAMERA.resized(*SIZE_PX), math.radians(pitch_deg))
    ids: NDArray[np.uint8] = np.full(SIZE_PX[::-1], CLASSES.ground, dtype=np.uint8)
    cv2.fillPoly(ids, [np.round(pixels * 16).astype(np.int32)], TOP, shift=4)
    return paper_map(ids=ids, captured_s=0.0)


def seen(
    class_map: ClassMap | None, pitch_deg: float, *, of: LandingMark, camera_m: float = CAMERA_M
) -> MarkSighting | None:
    view = view_of_classes(class_map, TAG_CAMERA, pitch_deg=pitch_deg, height_m=camera_m)
    return RegionFinder(of).find(view)


@pytest.mark.parametrize("height_m", [0.0, 0.3, 0.6])
@pytest.mark.parametrize(
    ("forward_m", "pitch_deg"), [(0.0, -90.0), (1.0, -50.0), (2.0, -35.0), (3.5, -25.0)]
)
def test_the_place_at_any_height(height_m: float, forward_m: float, pitch_deg: float) -> None:
    found = seen(drawn(height_m, forward_m, pitch_deg), pitch_deg, of=mark(height_m))
    assert found.forward_m - TAG_CAMERA.forward_offset_m == pytest.approx(forward_m, abs=0.03)
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


# --- the take-off spot ----------------------------------------------------------------------------

MARK = LandingMark(kind="spot", length_m=0.5, width_m=0.5, height_m=0.0)
AWAY = Pose2D(x_m=2.0, y_m=0.0, yaw_rad=0.0)
GROUND, PLAIN = texture(), np.full((SIDE_PX, SIDE_PX), 120, dtype=np.uint8)
Error = tuple[float, float, float]  # m, m, degrees


def back(
    ground: Image, body: Pose2D, off: Error, *, left: Image | None = None, pitch_deg: float = -90.0
) -> MarkSighting | None:
    """Return the sighting of a finder after five views at the take-off, and two at the return."""
    finder = SpotFinder(MARK)
    for index in range(5):
        place = Pose2D(x_m=0.02 * index - 0.04, y_m=0.01 * index, yaw_rad=0.0)
        seen = ground_view(ground if left is None else left, place, at_s=0.1 * index)
        tilted = replace(seen.frame, gimbal_pitch_rad=math.radians(pitch_deg))
        assert finder.find(replace(seen, frame=tilted)) is None
    assert finder.find(ground_view(ground, AWAY, at_s=5.0)) is None
    assert (
        finder.find(ground_view(ground, body, off=off, at_s=10.0)) is None
    )  # one view is not enough
    return finder.find(ground_view(ground, body, off=off, at_s=10.1))


@pytest.mark.parametrize("yaw_deg", [0.0, 80.0, -170.0])
@pytest.mark.parametrize("off", [(0.0, 0.0, 0.0), (0.3, -0.2, 2.0), (-0.4, 0.1, -3.0)])
def test_on_textured_ground_the_spot_is_found(yaw_deg: float, off: Error) -> None:
    body = Pose2D(x_m=0.1, y_m=-0.15, yaw_rad=math.radians(yaw_deg))
    found = back(GROUND, body, off)
    assert found is not None
    true = body.pose_to_body(AT_THE_SPOT)
    assert math.hypot(found.forward_m - true.x_m, found.right_m - true.y_m) < 0.03
    assert found.height_m == 0.0


def test_plain_or_other_ground_and_a_spot_not_seen_from_above_are_not_found() -> None:
    assert back(PLAIN, AT_THE_SPOT, (0.1, 0.0, 0.0)) is None
    other = np.ascontiguousarray(GROUND.T[::-1])
    assert back(other, AT_THE_SPOT, (0.0, 0.0, 0.0), left=GROUND) is None
    assert back(GROUND, AT_THE_SPOT, (0.0, 0.0, 0.0), pitch_deg=-42.0) is None


@pytest.mark.parametrize("off_m", [0.05, 0.1, 0.2, 0.25, 0.3, 0.4, 0.45])
def test_on_repeated_tiles_only_the_right_one_is_believed(off_m: float) -> None:
    """Tiles of half a metre: the estimate must leave no doubt which of them is meant."""
    found = back(np.tile(texture(50), (16, 16)), AT_THE_SPOT, (off_m, 0.0, 0.0))
    if off_m <= 0.1:
        assert found is not None
        assert math.hypot(found.forward_m, found.right_m) < 0.03
    elif off_m < 0.4:
        assert found is None
    elif found is not None:  # the next tile looks like the right one: off by a tile at most
        assert math.hypot(found.forward_m, found.right_m) < 0.55
