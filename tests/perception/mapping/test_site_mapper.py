"""The site map on exact views of the twin's lab: where things are, and how drift is corrected."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from perception.mapping.ground_grid import PASSED_M
from perception.mapping.mark_place import MOVED_VIEWS
from perception.mapping.registration import Contradiction
from perception.mapping.site_mapper import SiteMapper
from sim_bridge.anafi import CAMERA_FORWARD_M
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import Helipad, ObjectSpec
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.views import render_views
from tests.paper_lab import BOXES, CARPET, CLASSES
from tests.perception.mapping.mapping_world import AT_START, HEIGHT_M, PITCH_RAD, look
from tests.worlds import values
from uav_bt.types import Pose2D
from uav_bt.types.dead_reckoning import OdometryPose
from uav_bt.types.site_map import MapMark, SiteMap

PAD = Helipad(position_m=(-1.9, 1.4))
BOX = ObjectSpec(kind="box-3", position_m=(1.0, 0.4), yaw_deg=20, size_m=(0.4, 0.4, 1.9))
LOW = ObjectSpec(kind="box-5", position_m=(-1.2, -1.0), yaw_deg=60, size_m=(0.5, 0.4, 0.8))
SCENE = Scene(name="two", helipad=PAD, objects=(BOX, LOW))
STEP_S = 0.2

Drift = Callable[[float], tuple[float, float, float]]  # seconds: metres x, y and radians of yaw


@cache
def flown() -> list[tuple[Pose2D, NDArray[np.uint8]]]:
    """Return the true poses, in the map's convention, and the exact class ids seen from there.

    They go twice round a circle, the nose inwards half of the time.
    """
    poses, cameras = [], []
    for angle in np.arange(120) * math.tau / 60:
        yaw = float(angle + math.pi / 2 + 0.9 * math.sin(angle * 1.5))
        x_m, y_m = 0.6 * math.cos(angle), 0.5 * math.sin(angle)
        poses.append(Pose2D(x_m=x_m, y_m=-y_m, yaw_rad=-yaw))
        lens = x_m + CAMERA_FORWARD_M * math.cos(yaw), y_m + CAMERA_FORWARD_M * math.sin(yaw)
        cameras.append(
            CameraPose(x_m=lens[0], y_m=lens[1], z_m=HEIGHT_M, yaw_rad=yaw, pitch_rad=PITCH_RAD)
        )
    views = render_views(SCENE, cameras, truth_size_px=(224, 112))
    return [(pose, view.ids) for pose, view in zip(poses, views, strict=True)]


def slow_drift(time_s: float) -> tuple[float, float, float]:
    """Return what dead reckoning is off by: 1 cm/s, and 0.1 degrees a second."""
    return 0.01 * time_s, -0.004 * time_s, 0.0017 * time_s


def fly(
    mapper: SiteMapper, drift: Drift = lambda _: (0.0, 0.0, 0.0), *, from_s: float = 0.0
) -> list[SiteMap]:
    """Fly the circle and return the map after each view."""
    maps = []
    for index, (true, ids) in enumerate(flown()):
        time_s = from_s + index * STEP_S
        x_m, y_m, yaw_rad = drift(time_s)
        pose = OdometryPose(
            time_s=time_s, x_m=true.x_m + x_m, y_m=true.y_m + y_m, yaw_rad=true.yaw_rad + yaw_rad
        )
        maps.append(look(mapper, ids, pose))
    return maps


def test_a_map_has_everything_where_it_stands() -> None:
    found = fly(SiteMapper(CLASSES))[-1]
    assert len(found.obstacles_m) > 12
    for x_m, y_m in found.obstacles_m:
        assert min(box.footprint.distance_m(x_m, -y_m) for box in SCENE.placed) < 0.08
    classes = [box.shape.class_id for box in SCENE.placed]
    assert [thing.class_id for thing in found.objects] == classes
    for thing, box in zip(found.objects, SCENE.placed, strict=True):
        assert math.dist((thing.x_m, -thing.y_m), box.spec.position_m) < 0.12
    x, y = np.abs(found.edges_m).T
    off_m = np.minimum(np.abs(x - 2.5), np.abs(y - 2.0))
    assert len(off_m) > 50
    assert np.percentile(off_m, 95) < 0.08
    assert math.hypot(found.correction.x_m, found.correction.y_m) < 0.03

    places = np.abs(found.places_m())
    inside = (places[..., 0] < 2.3) & (places[..., 1] < 1.8)
    beyond = (places[..., 0] > 2.7) | (places[..., 1] > 2.2)
    assert not (found.ground & ~found.outside)[beyond].any()
    assert found.ground[inside].mean() > 0.8
    assert found.outside[beyond & np.isfinite(places[..., 0])].sum() > 100
    path = np.array([(pose.x_m, pose.y_m) for pose, _ in flown()])
    apart = np.hypot(*np.moveaxis(found.places_m()[found.passed][:, None] - path, -1, 0))
    assert apart.min(axis=1).max() <= PASSED_M + 0.1


def test_drift_is_corrected_by_what_is_seen_again() -> None:
    """What drifted before anything was seen twice stays; from then on half of it is taken away.

    The top of the first box is above the images: its height stays unknown.
    """
    maps = fly(SiteMapper(CLASSES), slow_drift)
    found, true, off = maps[-1], flown()[-1][0], slow_drift((len(flown()) - 1) * STEP_S)
    off_m = math.dist((found.pose.x_m, found.pose.y_m), (true.x_m, true.y_m))
    assert off_m < 0.6 * math.hypot(*off[:2])
    assert abs(math.remainder(found.pose.yaw_rad - true.yaw_rad, math.tau)) < 0.8 * off[2]
    assert found.restarts == 0
    ids = {(thing.class_id, thing.id) for each in maps for thing in each.objects}
    assert len(ids) == 2
    assert {one for _, one in ids} == {1, 2}
    high, low = found.objects
    assert high.height_m is None
    assert low.height_m == pytest.approx(LOW.size_m[2], abs=0.03)
    assert low.height_std_m == pytest.approx(0.02, abs=0.01)
    assert low.points >= 4


def test_a_map_that_views_contradict_is_begun_anew() -> None:
    """The drone is carried elsewhere: after some seconds the old map is given up, and said so."""
    mapper = SiteMapper(CLASSES)
    fly(mapper)
    later = fly(mapper, lambda _: (0.0, 0.0, 1.2), from_s=60.0)
    assert later[-1].restarts >= 1
    assert max(found.contradicted_s for found in later) > 0.0


def test_the_mark_corrects_and_is_remembered() -> None:
    mapper = SiteMapper(CLASSES)
    mapper.follow(values.motion(AT_START))
    mapper.see_mark(values.fix(0.0, 1.0, 0.5))
    for tenths in range(1, 600):
        drifted = values.motion(replace(AT_START, time_s=tenths / 10, x_m=0.1))
        mapper.follow(drifted)
        mapper.see_mark(values.fix(tenths / 10, 1.0, 0.5))
    found = mapper.map(drifted)
    assert math.dist((found.mark.x_m, found.mark.y_m), (1.0, 0.5)) < 0.03
    assert abs(found.pose.x_m) < 0.04


def test_the_map_keeps_the_direction_of_the_marks_upper_edge() -> None:
    for heading_deg, yaw_rad in ((None, None), (30.0, pytest.approx(math.radians(-30.0)))):
        mapper, here = SiteMapper(CLASSES), values.motion(AT_START)
        mapper.follow(here)
        mapper.see_mark(values.fix(0.0, 1.0, heading_deg=heading_deg))
        mapper.see_mark(values.fix(0.1, 1.0))
        assert mapper.map(here).mark.yaw_rad == yaw_rad


def show_ground(
    mapper: SiteMapper,
    time_s: float,
    x_m: float = -0.6,
    *,
    columns: slice = slice(0),
    from_row: int = 0,
    height_m: float = HEIGHT_M,
) -> SiteMap:
    """Let the mapper see ground, from x, with an obstacle in columns; return the map then."""
    ids = np.full((112, 224), CARPET, dtype=np.uint8)
    ids[from_row:, columns] = BOXES[2]
    return look(mapper, ids, replace(AT_START, time_s=time_s, x_m=x_m), height_m=height_m)


def sighted(
    mapper: SiteMapper, right_m: float, from_s: float, views: int, confidence: float = 1.0
) -> list[MapMark]:
    """Let the mapper sight a mark a metre ahead; return where it is after each view."""
    marks = []
    for time_s in from_s + np.arange(views) / 10:
        here = values.motion(replace(AT_START, time_s=time_s))
        mapper.follow(here)
        mapper.see_mark(values.fix(time_s, 1.0, right_m, confidence=confidence))
        marks.append(mapper.map(here).mark)
    return marks


@pytest.mark.parametrize(
    ("first_m", "confidence", "then_m", "views", "moved_m"),
    [
        # By as much as the map may have drifted a mark is moved, only by sightings again and again.
        pytest.param(0.5, 1.0, 0.0, MOVED_VIEWS, 0.5, id="drift"),
        # Ground was seen where it was.
        pytest.param(0.5, 1.0, -1.0, MOVED_VIEWS, 1.5, id="carried away"),
        # A mask may take a box for the mark, for seconds.
        pytest.param(0.5, 1.0, -1.0, 60, None, id="far from a mark that still stands"),
        # At take-off the image's border cuts the H, whose middle is then 0.25 m off.
        pytest.param(0.25, 0.45, 0.0, 1, 0.0, id="a good one after doubtful ones"),
    ],
)
def test_a_mark_is_moved_only_with_reason(
    *, first_m: float, confidence: float, then_m: float, views: int, moved_m: float | None
) -> None:
    mapper = SiteMapper(CLASSES)
    sighted(mapper, first_m, 0.0, 20, confidence)
    if moved_m == 1.5:
        show_ground(mapper, 3.0)
    *before, last = sighted(mapper, then_m, 4.0, views)
    assert all(mark.y_m == pytest.approx(first_m, abs=0.02) for mark in before)
    assert last.y_m == pytest.approx(first_m if moved_m is None else then_m, abs=0.03)
    assert last.moved_m == pytest.approx(moved_m or 0.0, abs=0.02)


AHEAD = slice(100, 140)  # columns


@pytest.mark.parametrize(
    ("from_m", "height_m", "from_row", "movers"),
    [
        pytest.param(-1.2, 1.5, 0, 1, id="on free ground"),
        pytest.param(0.0, 1.5, 0, 0, id="on unseen ground"),
        pytest.param(-1.2, 1.1, 0, 0, id="from low down"),
        pytest.param(-1.2, 1.5, 50, 0, id="low"),
    ],
)
def test_an_obstacle_on_free_ground_that_hides_its_base_is_a_mover_that_comes_near(
    from_m: float, height_m: float, from_row: int, movers: int
) -> None:
    mapper = SiteMapper(CLASSES)
    for tick in range(5):
        x_m = from_m * (1.0 - 0.25 * tick)
        assert not show_ground(mapper, 0.2 * tick, x_m, height_m=height_m).movers
    for time_s in (1.2, 1.3):
        found = show_ground(
            mapper, time_s, 0.0, columns=AHEAD, from_row=from_row, height_m=height_m
        )
        assert [each.id for each in found.movers] == [1] * movers
        assert (found.moved_s == 1.2) == bool(movers)
        for mover in found.movers:
            assert (mover.x_m, mover.y_m) == pytest.approx((2.1 - time_s, 0.1), abs=0.1)
            assert (mover.x_mps, mover.y_mps) == pytest.approx((-0.5, 0.0), abs=0.1)


def test_a_box_that_is_looked_at_from_far_stays_on_the_map() -> None:
    """From further than bases are placed, the error of the height is as large as the box."""
    mapper, rng = SiteMapper(CLASSES), np.random.default_rng(1)
    scene = Scene(name="far", helipad=PAD, objects=(replace(BOX, position_m=(2.0, -0.4)),))
    maps = []
    for lens_m, pitch_rad, first, views, std_m in (
        (0.4, PITCH_RAD, 0, 15, 0.0),
        (-2.2, math.radians(-30), 20, 60, 0.03),
    ):
        lens = CameraPose(x_m=lens_m, y_m=-0.4, z_m=HEIGHT_M, yaw_rad=0.0, pitch_rad=pitch_rad)
        (drawn,) = render_views(scene, [lens], truth_size_px=(224, 112))
        for index in range(first, first + views):
            pose = replace(AT_START, time_s=0.1 * index, x_m=lens_m - CAMERA_FORWARD_M, y_m=0.4)
            height_m = HEIGHT_M + float(rng.normal(0.0, std_m))
            found = look(mapper, drawn.ids, pose, pitch_rad, height_m)
        maps.append(found)
    near, later = maps
    assert len(near.objects) == len(later.objects) == 1
    assert len(later.obstacles_m) >= len(near.obstacles_m)


def test_views_contradict_the_map_by_their_share_of_ground() -> None:
    """A third is too little, and time without views does not count."""
    for step_s, free, lasts_s in ((0.2, 50, 1.8), (0.2, 30, 0.0), (0.6, 50, 0.0)):
        agreement = Contradiction(step_s)
        for view in range(1, 11):
            agreement.add(step_s * view, 100, free)
        assert agreement.lasts_s(10 * step_s) == pytest.approx(lasts_s, abs=1e-9)
        assert not agreement.is_certain(10 * step_s)
        assert agreement.is_certain(10 * step_s + 0.3) == (lasts_s > 0.0)


@pytest.mark.parametrize("heading_deg", [None, 30.0])
def test_on_a_tag_stands_nothing(heading_deg: float | None) -> None:
    """A tag that is seen is whole; parts of another mark may be hidden by what stands on it."""
    mapper = SiteMapper(CLASSES, mark_m=0.4)
    before = fly(mapper)[-1]
    x_m, y_m = before.obstacles_m[0]
    place_m, told = before.pose.to_body(float(x_m), float(y_m)), {"heading_deg": heading_deg}
    mapper.see_mark(values.fix(before.captured_s, *place_m, height_m=0.0, confidence=1.0, **told))
    after = fly(mapper)[-1]
    near = np.hypot(*(after.obstacles_m - (x_m, y_m)).T) <= 0.35
    assert near.any() == (heading_deg is None)
