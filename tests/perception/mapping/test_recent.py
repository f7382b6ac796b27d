"""Obstacles of recent views and landmarks of all views."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from perception.mapping.landmarks import (
    clusters,
    drop_missed,
    first_in_cells,
    merge,
    nearest_circles,
)
from perception.mapping.recent import RecentLayer
from perception.mapping.view import View
from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from tests.paper_lab import BACKGROUND, BOXES, CARPET, HELIPAD_BOX, paper_map
from tests.perception.mapping.mapping_world import points
from tests.worlds import values
from uav_bt.types import NearObstacles
from uav_bt.types.dead_reckoning import OdometryPose
from uav_bt.types.projection import pixel_rays

CAMERA = anafi_camera(640, 360).resized(224, 112)
PITCH_RAD = math.radians(-28)
HEIGHT_M = 1.5
Ids = NDArray[np.uint8]
GROUND = np.full((112, 224), CARPET, dtype=np.uint8)
ROWS, COLUMNS = np.mgrid[:112, :224]
RAYS = np.moveaxis(pixel_rays(np.stack([COLUMNS, ROWS], axis=-1), CAMERA, PITCH_RAD), -1, 0)


def with_box(forward_m: float, left_m: float, right_m: float) -> Ids:
    """Ray-cast a high box's front face: its distance ahead of the camera, its ends to the right."""
    across, down = forward_m / RAYS[0] * RAYS[1:]
    face = (across >= left_m) & (across <= right_m) & (down <= HEIGHT_M)
    return np.where(face, BOXES[0], GROUND).astype(np.uint8)


def ground_to(forward_m: float) -> Ids:
    """Put background where ground is further ahead of the camera than that."""
    beyond = RAYS[2] * forward_m < HEIGHT_M * RAYS[0]
    return np.where(beyond, BACKGROUND, GROUND).astype(np.uint8)


FAR_BOX = with_box(2.0, -0.4, 0.4)
NEAR_BOX = with_box(0.8, 0.2, 0.6)  # its base is below the image


def at(time_s: float, x_m: float = 0.0, yaw_rad: float = 0.0) -> OdometryPose:
    return OdometryPose(time_s=time_s, x_m=x_m, y_m=0.0, yaw_rad=yaw_rad)


class Flight:
    """The layer of a flight that has begun with a look."""

    def __init__(self, ids: Ids, yaw_rad: float = 0.0) -> None:
        self.recent = RecentLayer()
        self.begun = self.look(ids, at(0.0, yaw_rad=yaw_rad))

    def near(self, pose: OdometryPose) -> NearObstacles:
        self.recent.expire(pose.time_s)
        return self.recent.near(pose)

    def look(self, ids: Ids, pose: OdometryPose, pitch_rad: float = PITCH_RAD) -> NearObstacles:
        frame = values.frame((36, 64), pitch_rad, HEIGHT_M, captured_s=pose.time_s)
        view = View.of(paper_map(ids=ids, captured_s=pose.time_s), frame, CAMERA, pose)
        if view is None:
            self.recent.pass_over(pose.time_s)
        else:
            self.recent.add(view)
        return self.near(pose)


def test_a_base_is_remembered_after_it_left_the_view() -> None:
    """Flown past and turned away from, the box is still where it was."""
    flight = Flight(with_box(2.0, 0.4, 0.8))
    found = flight.near(at(3.1, 1.5, math.pi / 2)).points_m

    # It was 2.0 + 0.15 ahead of the centre; 1.5 m flown; turned right.
    ahead = 2.0 + CAMERA_FORWARD_M - 1.5
    assert np.median(np.abs(found[:, 1] + ahead)) < 0.04
    assert found[:, 1].max() < -ahead + 0.06
    assert (found[:, 0].min(), found[:, 0].max()) == pytest.approx((0.4, 0.8), abs=0.08)


def test_seen_again_a_point_is_kept_once_until_ground_shows_there() -> None:
    """Ten looks at one box leave as many points as one look."""
    flight = Flight(FAR_BOX)
    count = len(flight.begun.points_m)
    assert count > 5
    for tenths in range(1, 10):
        assert len(flight.look(FAR_BOX, at(0.1 * tenths)).points_m) == count
    found = flight.look(GROUND, at(1.0))
    assert found.points_m.shape == (0, 2)
    assert found.nearest_m == math.inf


def test_old_points_are_forgotten_and_the_end_of_the_ground_later() -> None:
    """Dead reckoning drifts; a decimetre matters less at the edge, which is no obstacle."""
    ids = with_box(1.8, -0.3, 0.2)
    ids[:60][ids[:60] == CARPET] = BACKGROUND
    flight = Flight(ids)
    assert flight.begun.nearest_m == pytest.approx(1.8 + CAMERA_FORWARD_M, abs=0.1)
    for time_s, bases_left, edges_left in ((30.0, 1, 1), (30.1, 0, 1), (60.1, 0, 0)):
        found = flight.near(at(time_s))
        assert bool(len(found.points_m)) == bases_left
        assert np.allclose(found.points_age_s, time_s)
        assert (len(found.edges_m) > 10) == edges_left


def test_far_bases_and_the_pad_are_not_remembered() -> None:
    """Beyond the range a pixel is worth too many centimetres; the drone flies above the pad."""
    pad = np.where(FAR_BOX == CARPET, CARPET, HELIPAD_BOX).astype(np.uint8)
    for ids in (with_box(3.2, -0.4, 0.4), pad):
        assert len(Flight(ids).begun.points_m) == 0


def test_looking_down_adds_nothing_and_forgets_nothing() -> None:
    """Straight down a roof is nearer than any base."""
    flight = Flight(FAR_BOX)
    found = flight.look(GROUND, at(0.1), pitch_rad=-math.pi / 2)
    assert np.array_equal(found.points_m, flight.begun.points_m)
    assert found.captured_s == pytest.approx(0.1)


def test_an_unexplained_near_box_is_assumed_anywhere_on_its_bearing() -> None:
    """At the assumed ranges, for the assumed time; no longer, since it was never seen there."""
    flight = Flight(NEAR_BOX, yaw_rad=3.0)
    found = flight.begun
    assert len(found.points_m) == 0
    assert len(found.unplaced_rad) > 5
    ranges = np.hypot(*found.assumed_m.T)
    bearings = np.arctan2(found.assumed_m[:, 1], found.assumed_m[:, 0])
    assert np.unique(np.round(ranges, 6)) == pytest.approx([0.4, 0.6, 0.8, 1.0])
    ends = found.unplaced_rad.min(), found.unplaced_rad.max()
    assert (bearings.min(), bearings.max()) == pytest.approx(ends, abs=0.1)
    assert ends == pytest.approx((math.atan2(0.2, 0.95), math.atan2(0.6, 0.95)), abs=0.05)

    for time_s, lasts in ((9.9, True), (10.1, False)):  # bearings turn as the drone does
        later = flight.near(at(time_s, yaw_rad=3.0 + 1.0 - 2 * math.pi))
        assert later.unplaced_rad == pytest.approx(found.unplaced_rad - 1.0)
        assert bool(len(later.assumed_m)) is lasts


def test_ground_at_the_lower_edge_ends_what_is_assumed_before_it() -> None:
    """The view begins further away than the first assumed range; a tall box would reach into it."""
    flight = Flight(with_box(0.8, -0.2, 0.2))
    count = len(flight.begun.assumed_m)
    assert count > 20
    elsewhere = flight.look(GROUND, at(0.1, yaw_rad=math.pi))
    assert len(elsewhere.assumed_m) == count
    assert len(flight.look(GROUND, at(0.2)).assumed_m) == 0


def test_a_remembered_base_explains_the_near_box() -> None:
    """The base seen from further away is the same box: its range is known."""
    flight = Flight(with_box(1.8, -0.3, 0.3))
    ids = GROUND.copy()
    ids[:, 90:134] = BOXES[0]
    found = flight.look(ids, at(1.0, 1.0))
    assert len(found.points_m) > 5
    assert len(found.unplaced_rad) == 0
    assert found.nearest_m == pytest.approx(1.8 + CAMERA_FORWARD_M - 1.0, abs=0.06)
    assert found.points_age_s[np.hypot(*found.points_m.T).argmin()] == 0.0  # the box is in view


def test_the_side_of_a_near_box_does_not_explain_it() -> None:
    """In a turn its vertical edge meets ground further away than the box, on single bearings."""
    flight = Flight(GROUND)
    for tick in range(200):
        yaw_rad = math.radians(0.3 * tick - 30)
        side_m = -0.5 * math.tan(yaw_rad)
        pose = at(0.05 * tick, yaw_rad=yaw_rad)
        found = flight.look(with_box(0.5, side_m, side_m + 0.5), pose)
        assert len(found.points_m) == 0
    assert len(found.unplaced_rad) > 20


def test_an_edge_nearer_than_the_view_is_kept_if_it_was_seen_before() -> None:
    """An obstacle is not made of it."""
    found = Flight(ground_to(0.8)).begun
    assert len(found.unplaced_rad) == len(found.edges_m) == len(found.assumed_m) == 0
    assert len(Flight(ground_to(2.0)).look(ground_to(0.8), at(2.4, x_m=1.2)).edges_m) > 10


def test_a_shorter_life_makes_nothing_older() -> None:
    """What may move is soon forgotten, and was seen lately all the same."""
    flight = Flight(FAR_BOX)
    flight.recent.forget_trails(2.5, np.array([[2.2, 0.0, 1.0]]))
    assert np.allclose(flight.near(at(1.0)).points_age_s, 1.0)
    assert not len(flight.near(at(2.6)).points_m)
    flight.look(FAR_BOX, at(2.7))
    flight.recent.forget()
    assert not len(flight.near(at(2.7)).points_m)


# --- the map's points -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("known", "seen", "x_m", "weight"),
    [
        pytest.param(1.0, [(1.06, 3.0)], 1.045, 4.0, id="weighted mean"),  # (1.00 + 3 x 1.06) / 4
        pytest.param(1.0, [(1.05, 1.0), (0.95, 1.0)], 1.0, 3.0, id="two sightings in a view"),
        pytest.param(3.0, [(1.05, 1.0)], 1.0, 4.0, id="enough sightings have placed it"),
    ],
)
def test_a_point_moves_to_the_weighted_mean_of_its_sightings(
    known: float, seen: list[tuple[float, float]], x_m: float, weight: float
) -> None:
    view = points(*[(x, 0.0) for x, _ in seen])
    view = replace(view, weight=np.array([each for _, each in seen]))
    found = merge(points((1.0, 0.0), weight=known), view)
    assert found.xy_m == pytest.approx(np.array([[x_m, 0.0]]))
    assert found.weight == pytest.approx([weight])


def test_a_point_goes_after_as_many_views_as_placed_it() -> None:
    """Weight 5: the fifth view that shows ground there removes it. The given table is kept."""
    known, free = points((1.0, 0.0), weight=5.0), np.array([True])
    for _ in range(4):
        known = drop_missed(known, free)
        assert len(known) == 1
    assert len(drop_missed(known, free)) == 0
    assert known.missed == pytest.approx([4.0])


@pytest.mark.parametrize("seed", range(3))
def test_clusters_are_those_of_single_linkage_in_the_order_of_first_points(seed: int) -> None:
    from scipy.cluster.hierarchy import fcluster, linkage

    xy_m = np.random.default_rng(seed).uniform(0.0, 4.0, (60, 2))
    labels = clusters(xy_m, 0.3)
    expected = fcluster(linkage(xy_m), 0.3, criterion="distance")
    together, expected_together = (one[:, None] == one for one in (labels, expected))
    assert np.array_equal(together, expected_together)
    _, firsts = np.unique(labels, return_index=True)
    assert (np.diff(firsts) > 0).all()
    assert clusters(np.empty((0, 2)), 0.3).tolist() == []


def test_the_nearest_circle_may_have_the_farther_centre() -> None:
    xy_m = np.array([[0.0, 0.0], [3.0, 4.0]])
    off_m, nearest = nearest_circles(xy_m, np.array([[1.0, 0.0], [0.0, 2.0]]), np.array([0.1, 1.5]))
    assert off_m == pytest.approx([0.5, np.hypot(3.0, 2.0) - 1.5])
    assert nearest.tolist() == [1, 1]
    assert nearest_circles(xy_m, np.empty((0, 2)))[0].tolist() == [np.inf, np.inf]


def test_of_a_cell_the_first_point_by_its_keys_is_kept() -> None:
    """Three points in cell (0, 0), one in cell (-1, 0), which comes first."""
    xy_m = np.array([[0.01, 0.01], [0.02, 0.02], [0.03, 0.03], [-0.01, 0.01]])
    assert first_in_cells(xy_m, 0.1).tolist() == [3, 0]
    assert first_in_cells(xy_m, 0.1, np.array([5.0, 4.0, 3.0, 9.0])).tolist() == [3, 2]
    kinds = np.array([1, 0, 1, 0], dtype=np.int8)  # the more important key
    assert first_in_cells(xy_m, 0.1, np.array([5.0, 4.0, 3.0, 9.0]), kinds).tolist() == [3, 1]
