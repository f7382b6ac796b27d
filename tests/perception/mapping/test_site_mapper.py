"""The site map on exact views of the twin's lab: where things are, and how drift is corrected."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from perception.mapping.ground_grid import PASSED_M
from perception.mapping.mark_place import MOVED_VIEWS
from perception.mapping.registration import Contradiction
from perception.mapping.site_mapper import SiteMapper
from perception.mapping.view import View
from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import BoxSpec, Helipad
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.views import render_views
from tests.paper_lab import BOXES, CARPET, CLASSES, paper_map
from tests.worlds import values
from uav_bt.types import BodyVelocity, ClassMap, Frame, Pose2D
from uav_bt.types.dead_reckoning import MotionEstimate, OdometryPose
from uav_bt.types.site_map import MapMark, SiteMap

CAMERA = anafi_camera(640, 360).resized(224, 112)
PITCH_RAD = math.radians(-42)
HEIGHT_M = 1.5
BOX = BoxSpec(pattern=3, position_m=(1.0, 0.4), yaw_deg=20, size_m=(0.4, 0.4, 1.9))
LOW = BoxSpec(pattern=5, position_m=(-1.2, -1.0), yaw_deg=60, size_m=(0.5, 0.4, 0.8))
SCENE = Scene(name="two", helipad=Helipad(position_m=(-1.9, 1.4)), boxes=(BOX, LOW))
STEP_S = 0.2
AT_START = OdometryPose(time_s=0.0, x_m=0.0, y_m=0.0, yaw_rad=0.0)

Drift = Callable[[float], tuple[float, float, float]]  # seconds: metres x, y and radians of yaw


def _circle() -> Iterator[tuple[float, float, float]]:
    """Body poses in the world, twice round a circle, the nose inwards half of the time."""
    for step in range(120):
        angle = step * math.tau / 60
        yaw = angle + math.pi / 2 + 0.9 * math.sin(angle * 1.5)
        yield 0.6 * math.cos(angle), 0.5 * math.sin(angle), yaw


@cache
def flown() -> list[tuple[Pose2D, NDArray[np.uint8]]]:
    """Return the true poses, in the map's convention, and the exact class ids seen from there."""
    poses = list(_circle())
    cameras = [
        CameraPose(
            x_m=x + CAMERA_FORWARD_M * math.cos(yaw),
            y_m=y + CAMERA_FORWARD_M * math.sin(yaw),
            z_m=HEIGHT_M,
            yaw_rad=yaw,
            pitch_rad=PITCH_RAD,
        )
        for x, y, yaw in poses
    ]
    views = render_views(SCENE, cameras, truth_size_px=(224, 112))
    return [
        (Pose2D(x_m=x, y_m=-y, yaw_rad=-yaw), view.ids)
        for (x, y, yaw), view in zip(poses, views, strict=True)
    ]


def no_drift(_: float) -> tuple[float, float, float]:
    return 0.0, 0.0, 0.0


def slow_drift(time_s: float) -> tuple[float, float, float]:
    """Return what dead reckoning is off by: 1 cm/s, and 0.1 degrees a second."""
    return 0.01 * time_s, -0.004 * time_s, 0.0017 * time_s


def fly(mapper: SiteMapper, drift: Drift = no_drift, *, from_s: float = 0.0) -> list[SiteMap]:
    """Fly the circle and return the map after each view."""
    maps = []
    for index, (true, ids) in enumerate(flown()):
        time_s = from_s + index * STEP_S
        x_m, y_m, yaw_rad = drift(time_s)
        pose = OdometryPose(
            time_s=time_s, x_m=true.x_m + x_m, y_m=true.y_m + y_m, yaw_rad=true.yaw_rad + yaw_rad
        )
        frame = values.frame((4, 8), PITCH_RAD, HEIGHT_M, captured_s=time_s, index=index)
        mapper.follow(motion(pose))
        look(mapper, paper_map(ids=ids, captured_s=time_s), frame, pose)
        maps.append(mapper.map(motion(pose)))
    return maps


def look(mapper: SiteMapper, class_map: ClassMap, frame: Frame, pose: Pose2D) -> None:
    """Let the mapper take in a frame that was captured at a dead-reckoned pose."""
    view = View.of(class_map, frame, CAMERA, pose)
    assert view is not None
    mapper.add(view)


def motion(pose: OdometryPose) -> MotionEstimate:
    still = BodyVelocity()
    return MotionEstimate(pose=pose, seen=pose, velocity=still, error=still, tracked_s=pose.time_s)


def to_world(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return points * (1.0, -1.0)


@cache
def mapped() -> SiteMap:
    """Return the map after a flight without drift."""
    return fly(SiteMapper(CLASSES))[-1]


def test_bases_stand_on_the_boxes_outlines() -> None:
    found = mapped()
    assert len(found.obstacles_m) > 12
    for x_m, y_m in to_world(found.obstacles_m):
        nearest = min(box.footprint.distance_m(x_m, y_m) for box in SCENE.boxes)
        assert nearest < 0.08


def test_edges_lie_on_the_grounds_edge() -> None:
    found = mapped()
    x, y = np.abs(found.edges_m).T
    off_m = np.minimum(np.abs(x - 2.5), np.abs(y - 2.0))
    assert len(off_m) > 50
    assert np.percentile(off_m, 95) < 0.08


def test_the_map_has_ground_where_it_was_seen_and_outside_elsewhere() -> None:
    found = mapped()
    places = np.abs(found.places_m())
    inside = (places[..., 0] < 2.3) & (places[..., 1] < 1.8)
    beyond = (places[..., 0] > 2.7) | (places[..., 1] > 2.2)
    assert not (found.ground & ~found.outside)[beyond].any()
    assert found.ground[inside].mean() > 0.8
    assert found.outside[beyond & np.isfinite(places[..., 0])].sum() > 100


def test_both_boxes_are_objects_where_they_stand() -> None:
    found = mapped().objects
    assert [thing.class_id for thing in found] == [SCENE.class_of(box) for box in SCENE.boxes]
    for thing, box in zip(found, SCENE.boxes, strict=True):
        assert math.dist((thing.x_m, -thing.y_m), box.position_m) < 0.12


def test_objects_keep_their_ids_and_have_the_heights_of_the_boxes() -> None:
    """The roof of the first box is above the camera: its height stays unknown."""
    maps = fly(SiteMapper(CLASSES), slow_drift)
    ids = {(thing.class_id, thing.id) for found in maps for thing in found.objects}
    assert len(ids) == 2
    assert {one for _, one in ids} == {1, 2}
    high, low = maps[-1].objects
    assert high.height_m is None
    assert low.height_m == pytest.approx(LOW.size_m[2], abs=0.03)
    assert low.height_std_m == pytest.approx(0.02, abs=0.01)
    assert low.points >= 4


def test_drift_is_corrected_by_what_is_seen_again() -> None:
    """What drifted before anything was seen twice stays; from then on half of it is taken away."""
    found = fly(SiteMapper(CLASSES), slow_drift)[-1]
    true, off = flown()[-1][0], slow_drift((len(flown()) - 1) * STEP_S)
    off_m = math.dist((found.pose.x_m, found.pose.y_m), (true.x_m, true.y_m))
    assert off_m < 0.6 * math.hypot(*off[:2])
    assert abs(math.remainder(found.pose.yaw_rad - true.yaw_rad, math.tau)) < 0.8 * off[2]
    assert found.restarts == 0


def test_without_drift_nothing_is_corrected() -> None:
    correction = mapped().correction
    assert math.hypot(correction.x_m, correction.y_m) < 0.03


def test_a_map_that_views_contradict_is_begun_anew() -> None:
    """The drone is carried elsewhere: after some seconds the old map is given up, and said so."""
    mapper = SiteMapper(CLASSES)
    fly(mapper)
    later = fly(mapper, lambda _: (0.0, 0.0, 1.2), from_s=60.0)
    assert later[-1].restarts >= 1
    assert max(found.contradicted_s for found in later) > 0.0


def test_what_was_passed_is_near_the_path() -> None:
    found = mapped()
    path = np.array([(pose.x_m, pose.y_m) for pose, _ in flown()])
    places = found.places_m()[found.passed]
    apart = np.hypot(*np.moveaxis(places[:, None] - path, -1, 0)).min(axis=1)
    assert apart.max() <= PASSED_M + 0.1


def test_the_mark_corrects_and_is_remembered() -> None:
    mapper = SiteMapper(CLASSES)
    mapper.follow(motion(AT_START))
    mapper.see_mark(values.fix(0.0, 1.0, 0.5))
    for tenths in range(1, 600):
        drifted = replace(AT_START, time_s=tenths / 10, x_m=0.1)
        mapper.follow(motion(drifted))
        mapper.see_mark(values.fix(tenths / 10, 1.0, 0.5))
    found = mapper.map(motion(drifted))
    assert found.mark is not None
    assert math.dist((found.mark.x_m, found.mark.y_m), (1.0, 0.5)) < 0.03
    assert abs(found.pose.x_m) < 0.04


def sighted(
    mapper: SiteMapper, right_m: float, *, from_s: float, views: int, confidence: float = 1.0
) -> list[MapMark]:
    """Let the mapper sight a mark a metre ahead; return where it is after each view."""
    marks = []
    for index in range(views):
        time_s = from_s + index / 10
        here = motion(replace(AT_START, time_s=time_s))
        mapper.follow(here)
        mapper.see_mark(values.fix(time_s, 1.0, right_m, confidence=confidence))
        mark = mapper.map(here).mark
        assert mark is not None
        marks.append(mark)
    return marks


@pytest.mark.parametrize(("heading_deg", "yaw_deg"), [(None, None), (30.0, -30.0)])
def test_the_map_keeps_the_direction_of_the_marks_upper_edge(
    heading_deg: float | None, yaw_deg: float | None
) -> None:
    mapper, here = SiteMapper(CLASSES), motion(AT_START)
    mapper.follow(here)
    for captured_s in (0.0, 0.1):
        mapper.see_mark(
            values.fix(captured_s, 1.0, heading_deg=heading_deg if captured_s == 0.0 else None)
        )
    mark = mapper.map(here).mark
    assert mark is not None
    assert mark.yaw_rad == (None if yaw_deg is None else pytest.approx(math.radians(yaw_deg)))


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
    pose = replace(AT_START, time_s=time_s, x_m=x_m)
    mapper.follow(motion(pose))
    frame = values.frame((4, 8), PITCH_RAD, height_m, captured_s=time_s)
    ids = np.full((112, 224), CARPET, dtype=np.uint8)
    ids[from_row:, columns] = BOXES[2]
    look(mapper, paper_map(ids=ids, captured_s=time_s), frame, pose)
    return mapper.map(motion(pose))


def test_a_mark_is_moved_by_as_much_as_the_map_may_have_drifted() -> None:
    """Only by sightings again and again."""
    mapper = SiteMapper(CLASSES)
    sighted(mapper, 0.5, from_s=0.0, views=20)
    *before, last = sighted(mapper, 0.0, from_s=2.0, views=MOVED_VIEWS)
    assert all(mark.y_m == pytest.approx(0.5, abs=0.02) for mark in before)
    assert last.y_m == pytest.approx(0.0, abs=0.02)
    assert last.moved_m == pytest.approx(0.5, abs=0.02)


def test_a_doubtful_sighting_gives_way_to_a_good_one() -> None:
    """At take-off the image's border cuts the H, whose middle is then 0.25 m off."""
    mapper = SiteMapper(CLASSES)
    sighted(mapper, 0.25, from_s=0.0, views=20, confidence=0.45)
    mark = sighted(mapper, 0.0, from_s=2.0, views=1)[0]
    assert mark.y_m == pytest.approx(0.0, abs=0.03)
    assert mark.moved_m == 0.0
    here = motion(replace(AT_START, time_s=2.0))
    assert mapper.map(here).pose.y_m == pytest.approx(0.0, abs=0.03)


def test_sightings_far_from_a_mark_that_still_stands_are_errors() -> None:
    """A mask may take a box for the mark, for seconds."""
    mapper = SiteMapper(CLASSES)
    sighted(mapper, 0.5, from_s=0.0, views=20)
    for mark in sighted(mapper, -1.0, from_s=2.0, views=60):
        assert mark.y_m == pytest.approx(0.5, abs=0.02)
        assert mark.moved_m == 0.0


def test_a_mark_that_was_carried_away_is_found_elsewhere() -> None:
    """Ground was seen where it was."""
    mapper = SiteMapper(CLASSES)
    sighted(mapper, 0.5, from_s=0.0, views=20)
    show_ground(mapper, 3.0)
    last = sighted(mapper, -1.0, from_s=4.0, views=MOVED_VIEWS)[-1]
    assert last.y_m == pytest.approx(-1.0, abs=0.02)
    assert last.moved_m == pytest.approx(1.5, abs=0.02)


AHEAD = slice(100, 140)  # columns


def test_an_obstacle_on_free_ground_that_hides_its_base_is_a_mover_that_comes_near() -> None:
    mapper = SiteMapper(CLASSES)
    for tick in range(5):
        before = show_ground(mapper, 0.2 * tick, x_m=-1.2 + 0.3 * tick)
    assert not before.movers
    found = show_ground(mapper, 1.2, x_m=0.0, columns=AHEAD)

    (mover,) = found.movers
    assert found.moved_s == 1.2
    assert (mover.x_m, mover.y_m) == pytest.approx((0.9, 0.1), abs=0.1)
    assert (mover.x_mps, mover.y_mps) == pytest.approx((-0.5, 0.0), abs=0.1)
    again = show_ground(mapper, 1.3, x_m=0.0, columns=AHEAD)
    assert [each.id for each in again.movers] == [mover.id]


@pytest.mark.parametrize(
    ("from_m", "height_m", "from_row"), [(0.0, 1.5, 0), (-1.2, 1.1, 0), (-1.2, 1.5, 50)]
)
def test_on_unseen_ground_or_from_low_down_or_if_low_it_is_none(
    from_m: float, height_m: float, from_row: int
) -> None:
    mapper = SiteMapper(CLASSES)
    for tick in range(5):
        show_ground(mapper, 0.2 * tick, x_m=from_m * (1.0 - 0.25 * tick), height_m=height_m)
    found = show_ground(mapper, 1.2, x_m=0.0, columns=AHEAD, from_row=from_row, height_m=height_m)
    assert not found.movers


def hover(
    mapper: SiteMapper, at: CameraPose, *, from_s: float, views: int, height_std_m: float
) -> SiteMap:
    """Let the mapper see one view again and again, with an altimeter that errs."""
    (view,) = render_views(FAR, [at], truth_size_px=(224, 112))
    rng = np.random.default_rng(1)
    for index in range(views):
        time_s = from_s + 0.1 * index
        x_m, y_m = at.x_m - CAMERA_FORWARD_M, -at.y_m
        pose = OdometryPose(time_s=time_s, x_m=x_m, y_m=y_m, yaw_rad=0.0)
        mapper.follow(motion(pose))
        frame = values.frame(
            (4, 8),
            at.pitch_rad,
            at.z_m + float(rng.normal(0.0, height_std_m)),
            captured_s=time_s,
            index=index,
        )
        class_map = paper_map(ids=view.ids, captured_s=time_s)
        look(mapper, class_map, frame, pose)
    return mapper.map(motion(pose))


FAR = Scene(
    name="far",
    helipad=Helipad(position_m=(-1.9, 1.4)),
    boxes=(BoxSpec(pattern=3, position_m=(2.0, -0.4), yaw_deg=20, size_m=(0.4, 0.4, 1.9)),),
)


def test_a_box_that_is_looked_at_from_far_stays_on_the_map() -> None:
    """From further than bases are placed, the error of the height is as large as the box."""
    mapper = SiteMapper(CLASSES)
    near = CameraPose(x_m=0.4, y_m=-0.4, z_m=HEIGHT_M, yaw_rad=0.0, pitch_rad=PITCH_RAD)
    placed = hover(mapper, near, from_s=0.0, views=15, height_std_m=0.0)
    assert len(placed.objects) == 1
    far = CameraPose(x_m=-2.2, y_m=-0.4, z_m=HEIGHT_M, yaw_rad=0.0, pitch_rad=math.radians(-30))
    later = hover(mapper, far, from_s=2.0, views=60, height_std_m=0.03)
    assert len(later.obstacles_m) >= len(placed.obstacles_m)
    assert len(later.objects) == 1


@pytest.mark.parametrize(
    ("step_s", "free", "lasts_s"),
    [
        pytest.param(0.2, 50, 1.8, id="views show ground at half of the points"),
        pytest.param(0.2, 30, 0.0, id="at too few of them"),
        pytest.param(0.6, 50, 0.0, id="time without views does not count"),
    ],
)
def test_views_contradict_the_map_by_their_share_of_ground(
    step_s: float, free: int, lasts_s: float
) -> None:
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
    forward_m, right_m = before.pose.to_body(float(x_m), float(y_m))
    fix = values.fix(
        before.captured_s, forward_m, right_m, height_m=0.0, confidence=1.0, heading_deg=heading_deg
    )
    mapper.see_mark(fix)
    after = fly(mapper)[-1]
    near = np.hypot(*(after.obstacles_m - (x_m, y_m)).T) <= 0.35
    assert near.any() == (heading_deg is None)
