"""Heights of objects from their upper edges, in exact views of both labs from 1.5 m."""

import math

import pytest

from perception.mapping.upper_edges import upper_edges
from perception.mapping.view import View
from sim_bridge.anafi import CAMERA_FORWARD_M
from sim_bridge.plain.caster import Caster
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import ObjectSpec
from sim_bridge.twin.scene import Scene, TakeOffSpec
from tests.worlds import values
from uav_bt.types import ClassMap, Pose2D
from uav_bt.types.site_map import MapObject

FROM_M, HEIGHT_M = -2.0, 1.5
HIDDEN = pytest.approx(math.nan, nan_ok=True)


def heights(lab: str, specs: list[ObjectSpec], pitch_deg: float, off_m: float) -> list[float]:
    """Return the heights by a view ahead; the map has the objects too far away by `off_m`."""
    scene = Scene(name="drawn", lab=lab, objects=tuple(specs), take_off=TakeOffSpec(random=True))
    caster, pitch_rad = Caster(scene, (320, 180)), math.radians(pitch_deg)
    camera = CameraPose(x_m=FROM_M, y_m=0.0, z_m=HEIGHT_M, yaw_rad=0.0, pitch_rad=pitch_rad)
    view = View.of(
        ClassMap(ids=caster.cast(camera)[0], classes=scene.classes, captured_s=0.0),
        values.frame((4, 8), pitch_rad, HEIGHT_M, captured_s=0.0),
        caster.camera,
        Pose2D(x_m=FROM_M - CAMERA_FORWARD_M, y_m=0.0, yaw_rad=0.0),
    )
    assert view is not None
    known = []
    for item in scene.placed:
        base, times = item.footprint, {"std_m": 0.05, "seen_s": 0.0}
        sides = {"size_m": 2 * base.half_x_m, "width_m": 2 * base.half_y_m}
        place = {"x_m": base.x_m + off_m, "y_m": -base.y_m, "yaw_rad": -base.yaw_rad}
        known.append(MapObject(class_id=item.shape.class_id, **place, **sides, **times))
    return upper_edges(view, known).tolist()


def box(range_m: float, height_m: float, kind: str = "box-3", y_m: float = 0.0) -> ObjectSpec:
    place_m, size_m = (FROM_M + range_m, y_m), (0.4, 0.4, height_m)
    return ObjectSpec(kind=kind, position_m=place_m, yaw_deg=20, size_m=size_m)


@pytest.mark.parametrize(
    ("pitch_deg", "specs", "expected_m"),
    [
        pytest.param(-42, [box(1.5, 0.8)], [0.8], id="an upper face"),
        pytest.param(-10, [box(1.5, 1.4)], [1.4], id="a little below the camera"),
        pytest.param(12, [box(2.0, 1.9)], [1.9], id="above the camera"),
        pytest.param(-5, [box(3.5, 1.9)], [1.9], id="above it, from a distance"),
        pytest.param(-42, [box(2.0, 1.9)], [HIDDEN], id="the top is above the image"),
        pytest.param(30, [box(2.0, 0.8)], [HIDDEN], id="the box is below the image"),
        pytest.param(
            12, [box(1.5, 0.8), box(2.6, 1.9, "box-5")], [HIDDEN, 1.9], id="behind another box"
        ),
        pytest.param(12, [box(1.5, 1.3), box(2.6, 1.9)], [HIDDEN, HIDDEN], id="two of one class"),
        pytest.param(0, [box(2.0, 1.9), box(2.0, 1.2, y_m=0.8)], [1.9, 1.2], id="side by side"),
    ],
)
def test_boxes(pitch_deg: float, specs: list[ObjectSpec], expected_m: list[object]) -> None:
    for off_m, error_m in ((0.0, 0.01), (0.1, 0.06)):
        within = [one if one is HIDDEN else pytest.approx(one, abs=error_m) for one in expected_m]
        assert heights("paper", specs, pitch_deg, off_m) == within


@pytest.mark.parametrize("yaw_deg", [0, 30, 90])
@pytest.mark.parametrize(
    ("kind", "range_m", "pitch_deg", "expected_m"),
    [
        ("drum", 1.5, -30, 0.88),
        ("table", 2.5, -15, 0.75),
        ("table", 1.35, -15, None),  # its board begins below the image
        ("rack", 2.5, 12, 2.0),
        ("rack", 1.5, -15, None),  # one sees between its boards, up to the end of the image
    ],
)
def test_other_shapes(
    kind: str, range_m: float, pitch_deg: float, expected_m: float | None, yaw_deg: int
) -> None:
    spec = ObjectSpec(kind=kind, position_m=(FROM_M + range_m, 0.0), yaw_deg=yaw_deg)
    (found_m,) = heights("depot", [spec], pitch_deg, 0.0)
    assert math.isnan(found_m) if expected_m is None else abs(found_m - expected_m) < 0.03


def test_what_is_behind_a_table_is_not_measured() -> None:
    """The lower part of a crate is seen below the board, and its top is above the image."""
    table, crate = (
        ObjectSpec(kind=kind, position_m=(FROM_M + range_m, 0.0), yaw_deg=90)
        for kind, range_m in (("table", 2.35), ("tall_crate", 3.1))
    )
    found_m = heights("depot", [table, crate], -38, 0.0)
    assert found_m == [pytest.approx(0.75, abs=0.03), HIDDEN]


def test_an_object_of_one_class_is_measured_where_its_depth_matters_little() -> None:
    """The ridge of a barrier is above the middle of its base."""
    across, along = (
        ObjectSpec(kind="barrier", position_m=(FROM_M + 2.5, 0.0), yaw_deg=yaw_deg)
        for yaw_deg in (90, 0)
    )
    assert heights("depot", [across], -30, 0.0) == pytest.approx([0.8], abs=0.04)
    assert math.isnan(heights("depot", [along], -30, 0.0)[0])
