"""The recent layer: where bases stand, which points are dropped, which have no range yet."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from perception.mapping.contact_scan import Bases, find_bases, scan_ground
from perception.mapping.recent import RecentLayer
from perception.mapping.view import View
from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import BoxSpec, Helipad
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.views import render_views
from tests.paper_lab import BACKGROUND, BOXES, CARPET, HELIPAD_BOX, paper_map
from tests.worlds import values
from uav_bt.types import (
    Attitude,
    BodyVelocity,
    CameraModel,
    DroneState,
    FlyingState,
    Frame,
    NearObstacles,
)
from uav_bt.types.dead_reckoning import Odometry
from uav_bt.types.projection import pixel_rays, project

CAMERA = anafi_camera(640, 360).resized(224, 112)
PITCH_RAD = math.radians(-28)
HEIGHT_M = 1.5
Ids = NDArray[np.uint8]


def bare_ground() -> Ids:
    return np.full((112, 224), CARPET, dtype=np.uint8)


def draw_box(ids: Ids, forward_m: float, left_m: float, right_m: float) -> Ids:
    """Ray-cast a high box's front face: its distance ahead of the camera, its ends to the right."""
    rows, columns = np.mgrid[: ids.shape[0], : ids.shape[1]]
    rays = pixel_rays(np.stack([columns, rows], axis=-1), CAMERA, PITCH_RAD)
    across = forward_m / rays[..., 0] * rays[..., 1]
    down = forward_m / rays[..., 0] * rays[..., 2]
    ids[(across >= left_m) & (across <= right_m) & (down <= HEIGHT_M)] = BOXES[0]
    return ids


def end_ground(ids: Ids, forward_m: float) -> Ids:
    """Put background where ground is further ahead of the camera than that."""
    rows, columns = np.mgrid[: ids.shape[0], : ids.shape[1]]
    rays = pixel_rays(np.stack([columns, rows], axis=-1), CAMERA, PITCH_RAD)
    beyond = rays[..., 2] * forward_m < HEIGHT_M * rays[..., 0]
    ids[beyond & (ids == CARPET)] = BACKGROUND
    return ids


def frame(time_s: float, pitch_rad: float = PITCH_RAD) -> Frame:
    return values.frame((36, 64), pitch_rad, HEIGHT_M, captured_s=time_s)


class Flight:
    """A drone with telemetry that places its views."""

    def __init__(self) -> None:
        self.recent, self._odometry = RecentLayer(), Odometry()

    def predict(self, time_s: float, yaw_rad: float = 0.0, forward_mps: float = 0.0) -> None:
        sample = DroneState(
            captured_s=time_s,
            flying=FlyingState.FLYING,
            attitude=Attitude(yaw_rad=yaw_rad),
            velocity=BodyVelocity(forward_mps=forward_mps),
        )
        self.recent.expire(self._odometry.update(sample).time_s)

    def ahead(self, begin: int, end: int, forward_mps: float) -> None:
        """Fly ahead for some tenths of a second."""
        for tenths in range(begin, end):
            self.predict(0.1 * tenths, forward_mps=forward_mps)

    def points(self) -> NearObstacles:
        assert self._odometry.now is not None
        return self.recent.near(self._odometry.now)

    def look(self, ids: Ids, time_s: float, pitch_rad: float = PITCH_RAD) -> NearObstacles:
        pose = self._odometry.at(time_s)
        assert pose is not None
        class_map = paper_map(ids=ids, captured_s=time_s)
        view = View.of(class_map, frame(time_s, pitch_rad), CAMERA, pose)
        if view is None:
            self.recent.pass_over(time_s)
        else:
            self.recent.add(view)
        return self.points()


def looked(ids: Ids) -> Flight:
    """Return a flight after its first look."""
    flight = Flight()
    flight.predict(0.0)
    flight.look(ids, 0.0)
    return flight


FAR_BOX = (2.0, -0.4, 0.4)  # distance ahead of the camera, ends to the right
NEAR_BOX = (0.8, 0.2, 0.6)

# --- bases ----------------------------------------------------------------------------------------


def bases(ids: Ids) -> Bases:
    return find_bases(scan_ground(paper_map(ids=ids, captured_s=0.0), frame(0.0), CAMERA))


@pytest.mark.parametrize("forward_m", [1.6, 2.2, 3.0])
@pytest.mark.parametrize(("left_m", "right_m"), [(-0.3, 0.2), (0.3, 0.9)])
def test_a_base_is_where_the_box_meets_the_ground(
    forward_m: float, left_m: float, right_m: float
) -> None:
    """Within one pixel of the row, and as wide as the box; none of it is hidden."""
    found = bases(draw_box(bare_ground(), forward_m, left_m, right_m))

    # At the outline's ends a bearing may pass it and meet the face further up: behind, not before.
    pixel_m = 1.5 * (forward_m**2 + HEIGHT_M**2) / HEIGHT_M / CAMERA.fy_px
    error_m = found.placed_m[:, 0] - forward_m
    assert error_m.min() > -pixel_m
    assert np.median(np.abs(error_m)) < pixel_m
    assert np.count_nonzero(error_m > 2.0 * pixel_m) <= 2
    ends = found.placed_m[:, 1].min(), found.placed_m[:, 1].max()
    assert ends[0] == pytest.approx(left_m, abs=0.08)
    assert right_m - 0.08 < ends[1]
    assert found.hidden_m.shape == (0, 2)


def test_what_floats_before_the_background_has_no_base() -> None:
    """The box has no ground below it."""
    ids = draw_box(bare_ground(), 2.2, -0.3, 0.2)
    ids[ids == CARPET] = BACKGROUND

    assert bases(ids).placed_m.shape == (0, 2)
    assert bases(ids).hidden_m.shape == (0, 2)


def test_the_ground_ends_where_background_follows_it() -> None:
    """Across the view 2.5 m ahead, but not behind a box: the base of a box is not an edge."""
    ids = end_ground(draw_box(bare_ground(), 1.8, -0.3, 0.2), 2.5)

    edges_m = bases(ids).edges_m

    assert len(edges_m) > 20
    assert np.median(edges_m[:, 0]) == pytest.approx(2.5, abs=0.06)
    behind = np.abs(edges_m[:, 1] / edges_m[:, 0] + 0.03) < 0.1
    assert not behind.any()


def test_an_edge_nearer_than_the_view_has_bearings_and_no_place() -> None:
    """The view begins with background: the ground ends somewhere before."""
    found = bases(end_ground(bare_ground(), 0.8))

    assert found.edges_m.shape == (0, 2)
    assert len(found.hidden_edges_m) > 40
    assert found.hidden_m.shape == (0, 2)


def test_specks_have_no_base() -> None:
    """A few obstacle pixels on the ground are a mistake of the mask."""
    ids = bare_ground()
    assert bases(ids).hidden_m.shape == (0, 2)
    ids[60:62, 100:104] = BOXES[0]
    assert bases(ids).placed_m.shape == (0, 2)


@pytest.mark.parametrize("half_view_deg", [21, 35, 40])
def test_no_sample_lies_behind_the_camera(half_view_deg: int) -> None:
    """Pitched down by 1 rad, a lens of 80 degrees sees the ground behind the point below it."""
    focal_px = 56.0 / math.tan(math.radians(half_view_deg))
    wide = CameraModel(
        width_px=224, height_px=112, fx_px=focal_px, fy_px=focal_px, cx_px=111.5, cy_px=55.5
    )
    scan = scan_ground(paper_map(ids=bare_ground(), captured_s=0.0), frame(0.0, -1.0), wide)
    ranges_m = np.hypot(*np.moveaxis(scan.level_m, -1, 0))

    assert (scan.level_m[..., 0] > 0.0).all()
    assert (np.diff(ranges_m, axis=1) > 0.0).all()


def test_a_box_nearer_than_the_view_hides_its_base() -> None:
    """It gives the nearest ground in view on its bearings, and no base."""
    found = bases(draw_box(bare_ground(), 0.8, 0.2, 0.6))

    assert found.placed_m.shape == (0, 2)
    bearings = np.arctan2(found.hidden_m[:, 1], found.hidden_m[:, 0])
    assert bearings.min() == pytest.approx(math.atan2(0.2, 0.8), abs=math.radians(1.5))
    assert bearings.max() == pytest.approx(math.atan2(0.6, 0.8), abs=math.radians(1.5))
    edge = np.column_stack([found.hidden_m, np.full(len(found.hidden_m), HEIGHT_M)])
    assert (project(edge, CAMERA, PITCH_RAD)[:, 1] > 108).all()


def test_the_twins_box_is_where_it_stands() -> None:
    """From the twin's exact ids: every base within 5 cm of the box's outline."""
    box = BoxSpec(pattern=3, position_m=(0.8, 0.3), yaw_deg=30, size_m=(0.4, 0.4, 1.9))
    scene = Scene(name="box", helipad=Helipad(position_m=(-2.0, -1.5)), boxes=(box,))
    poses = [
        CameraPose(x_m=x, y_m=y, z_m=HEIGHT_M, yaw_rad=yaw, pitch_rad=PITCH_RAD)
        for x, y, yaw in ((-1.0, 0.0, 0.1), (-0.9, 1.0, -0.5), (0.8, -1.5, 1.5))
    ]
    for view in render_views(scene, poses, truth_size_px=(224, 112)):
        found = bases(view.ids)
        assert len(found.placed_m) > 5
        c, s = math.cos(view.pose.yaw_rad), math.sin(view.pose.yaw_rad)
        for forward_m, right_m in found.placed_m:
            x = view.pose.x_m + c * forward_m + s * right_m
            y = view.pose.y_m + s * forward_m - c * right_m
            distance_m = box.footprint.distance_m(x, y)
            assert distance_m < 0.05
            # Not inside either, as far as the outline can tell.
            shrunk = BoxSpec(pattern=3, position_m=(0.8, 0.3), yaw_deg=30, size_m=(0.3, 0.3, 1.9))
            assert shrunk.footprint.distance_m(x, y) > 0.0


# --- recent ---------------------------------------------------------------------------------------


def test_a_base_is_remembered_after_it_left_the_view() -> None:
    """Flown past and turned away from, the box is still where it was."""
    flight = Flight()
    flight.predict(0.0, forward_mps=0.5)
    flight.look(draw_box(bare_ground(), 2.0, 0.4, 0.8), 0.0)
    flight.ahead(1, 31, 0.5)
    flight.predict(3.1, yaw_rad=math.pi / 2)

    found = flight.points().points_m

    # It was 2.0 + 0.15 ahead of the centre; 1.5 m flown and half a tick of braking; turned right.
    ahead = 2.0 + CAMERA_FORWARD_M - 1.5 - 0.025
    assert np.median(np.abs(found[:, 1] + ahead)) < 0.04
    assert found[:, 1].max() < -ahead + 0.06
    assert (found[:, 0].min(), found[:, 0].max()) == pytest.approx((0.4, 0.8), abs=0.08)


def test_seen_again_a_point_is_kept_once_until_ground_shows_there() -> None:
    """Ten looks at one box leave as many points as one look."""
    ids, flight = draw_box(bare_ground(), *FAR_BOX), Flight()
    counts = []
    for tenths in range(10):
        flight.predict(0.1 * tenths)
        counts.append(len(flight.look(ids, 0.1 * tenths).points_m))
    assert set(counts) == {counts[0]}
    assert counts[0] > 5
    flight.predict(1.0)
    found = flight.look(bare_ground(), 1.0)
    assert found.points_m.shape == (0, 2)
    assert found.nearest_m == math.inf


def test_old_points_are_forgotten_and_the_end_of_the_ground_later() -> None:
    """Dead reckoning drifts; a decimetre matters less at the edge, which is no obstacle."""
    ids = draw_box(bare_ground(), 1.8, -0.3, 0.2)
    ids[:60][ids[:60] == CARPET] = BACKGROUND
    flight = looked(ids)
    assert flight.points().nearest_m == pytest.approx(1.8 + CAMERA_FORWARD_M, abs=0.1)
    for time_s, bases_left, edges_left in ((30.0, True, True), (30.1, False, True)):
        flight.predict(time_s)
        found = flight.points()
        assert bool(len(found.points_m)) is bases_left
        assert np.allclose(found.points_age_s, time_s)
        assert (len(found.edges_m) > 10) is edges_left
    flight.predict(60.1)
    assert len(flight.points().edges_m) == 0


def test_far_bases_and_the_pad_are_not_remembered() -> None:
    """Beyond the range a pixel is worth too many centimetres; the drone flies above the pad."""
    flight = Flight()
    flight.predict(0.0)
    ids = draw_box(bare_ground(), 3.2, -0.4, 0.4)
    assert len(flight.look(ids, 0.0).points_m) == 0
    ids = draw_box(bare_ground(), *FAR_BOX)
    pad = np.where(ids == CARPET, CARPET, HELIPAD_BOX).astype(np.uint8)
    assert len(looked(pad).points().points_m) == 0


def test_looking_down_adds_nothing_and_forgets_nothing() -> None:
    """Straight down a roof is nearer than any base."""
    flight = looked(draw_box(bare_ground(), *FAR_BOX))
    before = flight.points().points_m
    flight.predict(0.1)
    found = flight.look(bare_ground(), 0.1, pitch_rad=-math.pi / 2)
    assert np.array_equal(found.points_m, before)
    assert found.captured_s == pytest.approx(0.1)


def test_an_unexplained_near_box_is_a_bearing() -> None:
    """Its bearings, from the body's centre, turn as the drone does."""
    flight = Flight()
    flight.predict(0.0, yaw_rad=3.0)
    found = flight.look(draw_box(bare_ground(), *NEAR_BOX), 0.0)
    assert len(found.unplaced_rad) > 5
    assert (found.unplaced_rad > 0.1).all()
    flight.predict(0.1, yaw_rad=3.0 + 1.0 - 2 * math.pi)
    assert flight.points().unplaced_rad == pytest.approx(found.unplaced_rad - 1.0)


def test_an_unexplained_near_box_is_assumed_anywhere_on_its_bearing() -> None:
    """At the assumed ranges, for the assumed time; no longer, since it was never seen there."""
    flight = looked(draw_box(bare_ground(), *NEAR_BOX))
    found = flight.points()
    assert len(found.points_m) == 0
    ranges = np.hypot(*found.assumed_m.T)
    bearings = np.arctan2(found.assumed_m[:, 1], found.assumed_m[:, 0])
    assert np.unique(np.round(ranges, 6)) == pytest.approx([0.4, 0.6, 0.8, 1.0])
    assert bearings.min() == pytest.approx(found.unplaced_rad.min(), abs=0.1)
    assert bearings.max() == pytest.approx(found.unplaced_rad.max(), abs=0.1)

    flight.predict(9.9)
    assert len(flight.points().assumed_m) > 0
    flight.predict(10.1)
    assert len(flight.points().assumed_m) == 0


def test_ground_at_the_lower_edge_ends_what_is_assumed_before_it() -> None:
    """The view begins further away than the first assumed range; a tall box would reach into it."""
    flight = looked(draw_box(bare_ground(), 0.8, -0.2, 0.2))
    assumed = flight.points().assumed_m
    assert len(assumed) > 20
    flight.predict(0.1, yaw_rad=math.pi)
    assert len(flight.look(bare_ground(), 0.1).assumed_m) == len(assumed)  # it looks elsewhere
    flight.predict(0.2)
    assert len(flight.look(bare_ground(), 0.2).assumed_m) == 0


def test_a_remembered_base_explains_the_near_box() -> None:
    """The base seen from further away is the same box: its range is known."""
    flight = Flight()
    flight.predict(0.0, forward_mps=1.0)
    flight.look(draw_box(bare_ground(), 1.8, -0.3, 0.3), 0.0)
    flight.ahead(1, 11, 1.0)
    ids = bare_ground()
    ids[:, 90:134] = BOXES[0]
    found = flight.look(ids, 1.0)
    assert len(found.points_m) > 5
    assert len(found.unplaced_rad) == 0
    assert found.nearest_m == pytest.approx(1.8 + CAMERA_FORWARD_M - 1.0, abs=0.06)
    assert found.points_age_s[np.hypot(*found.points_m.T).argmin()] == 0.0  # the box is in view


def test_the_side_of_a_near_box_does_not_explain_it() -> None:
    """In a turn its vertical edge meets ground further away than the box, on single bearings."""
    flight = Flight()
    for tick in range(200):
        yaw_rad = math.radians(0.3 * tick - 30)
        side_m = -0.5 * math.tan(yaw_rad)
        flight.predict(0.05 * tick, yaw_rad=yaw_rad)
        found = flight.look(draw_box(bare_ground(), 0.5, side_m, side_m + 0.5), 0.05 * tick)
        assert len(found.points_m) == 0
    assert len(found.unplaced_rad) > 20


def test_an_edge_that_was_never_seen_is_marked_by_its_bearings() -> None:
    """Its bearings turn with the drone, and an obstacle is not made of it."""
    flight = looked(end_ground(bare_ground(), 0.8))
    found = flight.points()
    assert len(found.unplaced_edges_rad) > 40
    assert len(found.unplaced_rad) == len(found.edges_m) == len(found.assumed_m) == 0
    flight.predict(0.1, yaw_rad=1.0)
    assert flight.points().unplaced_edges_rad == pytest.approx(found.unplaced_edges_rad - 1.0)


def test_a_remembered_edge_explains_one_that_is_nearer_than_the_view() -> None:
    """Flown up to, it is where it was seen to be."""
    flight = Flight()
    flight.predict(0.0, forward_mps=0.5)
    flight.look(end_ground(bare_ground(), 2.0), 0.0)
    flight.ahead(1, 25, 0.5)
    found = flight.look(end_ground(bare_ground(), 0.8), 2.4)
    assert not (np.abs(found.unplaced_edges_rad) < math.radians(20)).any()
    assert len(found.edges_m) > 10


def test_all_can_be_forgotten() -> None:
    flight = looked(draw_box(bare_ground(), *FAR_BOX))
    assert len(flight.points().points_m)
    flight.recent.forget()
    assert not len(flight.points().points_m)


def test_a_shorter_life_makes_nothing_older() -> None:
    """What may move is soon forgotten, and was seen lately all the same."""
    flight = looked(draw_box(bare_ground(), *FAR_BOX))
    flight.recent.forget_trails(2.5, np.array([[2.2, 0.0, 1.0]]))
    flight.predict(1.0)
    assert np.allclose(flight.points().points_age_s, 1.0)
    flight.predict(2.6)
    assert not len(flight.points().points_m)
