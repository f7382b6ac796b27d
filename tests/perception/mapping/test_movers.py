"""What moves: sightings with the noise of depth and odometry, and exact views of the twin's lab."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from perception.mapping.mover_track import STAYS_S
from perception.mapping.movers import LIFE_S, TURNED_RATIO, WAITS_S, MoverTracker
from perception.mapping.site_mapper import SiteMapper
from perception.mapping.view import View
from sim_bridge.anafi import anafi_camera
from tests.paper_lab import BOXES, CARPET, CLASSES, paper_map
from tests.worlds import values
from uav_bt.types import BodyVelocity
from uav_bt.types.arrays import Floats
from uav_bt.types.dead_reckoning import MotionEstimate, OdometryPose
from uav_bt.types.site_map import MapMover, SiteMap

STEP_S = 0.1
RADIUS_M = 0.2
HERE_M = np.array([0.0, 0.0])


def face(middle_m: Floats, rng: np.random.Generator, drift_m: float) -> Floats:
    """Return the bases of a cylinder as they are seen from `HERE_M`, some centimetres off.

    A view errs as a whole by the odometry's noise, each point by that of its pixel.
    """
    towards = math.atan2(*(HERE_M - middle_m)[::-1])
    angles = towards + np.linspace(-1.2, 1.2, 9)
    arc = middle_m + RADIUS_M * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return np.asarray(arc + rng.normal(0.0, drift_m, 2) + rng.normal(0.0, 0.03, arc.shape))


def follow(
    tracker: MoverTracker,
    path: Callable[[float], tuple[float, float]],
    *,
    until_s: float,
    from_s: float = 0.0,
    drift_m: float = 0.03,
    seed: int = 0,
) -> Iterator[tuple[float, tuple[MapMover, ...], bool]]:
    """Yield time, movers, and whether all of the thing's points stand, view by view."""
    rng = np.random.default_rng(seed)
    for step in range(round(from_s / STEP_S), round(until_s / STEP_S)):
        time_s = step * STEP_S
        points_m = face(np.array(path(time_s)), rng, drift_m)
        stands = tracker.follow(points_m, HERE_M, time_s)
        yield time_s, tracker.movers(time_s), bool(stands.all())


@pytest.mark.parametrize("seed", range(8))
def test_a_box_seen_again_and_again_with_noise_is_no_mover(seed: int) -> None:
    for _, movers, _ in follow(MoverTracker(), lambda _: (2.0, 0.5), until_s=60.0, seed=seed):
        assert movers == ()


@pytest.mark.parametrize("seed", range(4))
def test_a_box_that_the_maps_drift_carries_along_is_no_mover(seed: int) -> None:
    """A correction of the drift moves all that is seen by a decimetre at once, again and again."""

    def path(time_s: float) -> tuple[float, float]:
        return 2.0 + 0.1 * (int(time_s) // 4 % 2), 0.5 + 0.01 * time_s

    for _, movers, _ in follow(MoverTracker(), path, until_s=15.0, seed=seed):
        assert movers == ()


@pytest.mark.parametrize("seed", range(4))
def test_a_box_that_comes_into_reach_bit_by_bit_is_no_mover(seed: int) -> None:
    """The reach of the map grows while the drone climbs, and the middle of what it shows moves."""
    tracker, rng = MoverTracker(), np.random.default_rng(seed)
    side_m = np.column_stack([np.full(12, 2.5), np.linspace(-0.3, 0.3, 12)])
    for step in range(30):
        points_m = side_m[: 4 + step // 2] + rng.normal(0.0, 0.01, 2)
        cut = np.arange(len(points_m)) == min(len(points_m), 12) - 1
        tracker.follow(points_m, HERE_M, step * STEP_S, cut=cut & (len(points_m) < 12))
        assert tracker.movers(step * STEP_S) == ()


@pytest.mark.parametrize("seed", range(8))
def test_the_legs_and_the_seat_of_a_chair_are_no_mover(seed: int) -> None:
    """The base jumps between legs, and on to the shadow of the seat, wherever the drone is."""
    tracker, rng = MoverTracker(), np.random.default_rng(seed)
    for step in range(100):
        place_m = np.array([1.8, 0.0]) + 0.25 * rng.integers(-1, 2, 2)
        tracker.follow(face(place_m, rng, 0.03), HERE_M, step * STEP_S)
        assert tracker.movers(step * STEP_S) == ()


def test_an_edge_above_the_ground_seen_by_a_drone_that_passes_is_no_mover() -> None:
    """The edge seems to move against the drone, at up to two thirds of its speed."""
    tracker = MoverTracker()
    for step in range(30):
        here_m = np.array([0.0, 0.05 * step])
        points_m = face(np.array([2.0, 0.5 - 0.6 * here_m[1]]), np.random.default_rng(step), 0.01)
        tracker.follow(points_m, here_m, step * STEP_S)
        assert tracker.movers(step * STEP_S) == ()


@pytest.mark.parametrize("speed_mps", [0.2, 0.5, 1.0])
@pytest.mark.parametrize("seed", range(4))
def test_a_cart_that_crosses_is_a_mover_soon_with_its_velocity(speed_mps: float, seed: int) -> None:
    tracker, confirmed_s = MoverTracker(), math.inf
    until_s = min(2.4 / speed_mps, 6.0)
    for time_s, movers, _ in follow(
        tracker, lambda s: (2.0, -1.2 + speed_mps * s), until_s=until_s, seed=seed
    ):
        if movers:
            confirmed_s = min(confirmed_s, time_s)
    (mover,) = movers
    assert confirmed_s <= 0.5 + 0.45 / speed_mps
    assert math.hypot(mover.x_mps, mover.y_mps - speed_mps) < 0.12
    assert math.dist((mover.x_m, mover.y_m), (2.0, -1.2 + speed_mps * time_s)) < 0.2
    assert mover.speed_mps == pytest.approx(speed_mps, abs=0.12)
    ahead = mover.at(np.array([0.0, 2.0]))
    assert math.dist(ahead[1], ahead[0]) == pytest.approx(2.0 * mover.speed_mps)


@pytest.mark.parametrize("speed_mps", [0.0, 0.25, 0.3, 0.35])
@pytest.mark.parametrize("seed", range(8))
def test_what_comes_below_the_view_before_it_is_confirmed_is_a_mover(
    speed_mps: float, seed: int
) -> None:
    """It comes towards the drone for 0.8 s; a box for as long is none."""
    tracker = MoverTracker()
    list(
        follow(tracker, lambda s: (1.2 - speed_mps * s, 0.0), until_s=0.8, drift_m=0.01, seed=seed)
    )
    for time_s in (0.8, 0.9, 1.0, 1.1):
        tracker.follow(np.empty((0, 2)), HERE_M, time_s)
    assert len(tracker.movers(1.1)) == (speed_mps > 0.0)


@pytest.mark.parametrize("speed_mps", [0.0, 0.35])
@pytest.mark.parametrize("seed", range(8))
def test_near_the_camera_a_mover_is_confirmed_sooner(speed_mps: float, seed: int) -> None:
    path = follow(
        MoverTracker(),
        lambda time_s: (1.2 - speed_mps * time_s, 0.0),
        until_s=1.0,
        drift_m=0.01,
        seed=seed,
    )
    first_s = min((time_s for time_s, movers, _ in path if movers), default=math.inf)
    assert first_s <= 0.8 if speed_mps else first_s == math.inf


def test_out_of_view_a_mover_goes_on_less_and_less_surely_and_is_forgotten() -> None:
    tracker = MoverTracker()
    time_s, seen, _ = list(follow(tracker, lambda s: (2.0, -1.2 + 0.5 * s), until_s=3.0))[-1]
    unseen_s, stds = time_s, [seen[0].std_m]
    while tracker.movers(unseen_s):
        unseen_s += STEP_S
        tracker.follow(np.empty((0, 2)), HERE_M, unseen_s)
        stds += [mover.std_m for mover in tracker.movers(unseen_s)]
    assert unseen_s - time_s == pytest.approx(LIFE_S, abs=0.15)
    assert stds == sorted(stds)
    assert stds[-1] > stds[0] + 0.3


def test_a_mover_that_has_left_the_view_may_have_turned() -> None:
    """After a while it is anywhere within the way that it covers from its last place."""
    tracker = MoverTracker()
    time_s, seen, _ = list(follow(tracker, lambda s: (2.0, -1.2 + 0.5 * s), until_s=3.0))[-1]
    for step in range(1, 31):
        tracker.follow(np.empty((0, 2)), HERE_M, time_s + step * STEP_S)
    (lost,) = tracker.movers(time_s + 3.0)
    assert math.dist((lost.x_m, lost.y_m), (seen[0].x_m, seen[0].y_m)) < 0.1
    assert lost.speed_mps == 0.0
    assert lost.std_m == pytest.approx(3.0 * 0.5 * TURNED_RATIO, rel=0.2)
    assert tracker.places_m() == pytest.approx(np.array([[lost.x_m, lost.y_m]]))


def test_a_mover_that_is_found_again_elsewhere_is_one_mover() -> None:
    """It turned out of view: the place where it was lost is dropped once it is seen to move."""
    tracker = MoverTracker()
    *_, (time_s, _, _) = follow(tracker, lambda s: (2.0, -1.2 + 0.5 * s), until_s=3.0)
    lost_s = time_s + 2.0
    for step in range(1, 21):
        tracker.follow(np.empty((0, 2)), HERE_M, time_s + step * STEP_S)
    for step in range(1, 16):
        now_s = lost_s + step * STEP_S
        y_m = 1.2 + 0.5 * (now_s - lost_s)
        points_m = np.array([(2.0, y_m + offset) for offset in (-0.1, 0.0, 0.1, 0.2)])
        tracker.follow(points_m, HERE_M, now_s)
    (mover,) = tracker.movers(now_s)
    assert tracker.moved_s == now_s
    assert mover.y_m == pytest.approx(y_m, abs=0.2)


def stop_and_go(time_s: float) -> tuple[float, float]:
    """Return a place on a path: 2 s at 0.6 m/s, 7 s of standing, and on."""
    return 2.0, -1.2 + 0.6 * (min(time_s, 2.0) + max(time_s - 9.0, 0.0))


def test_a_mover_that_stops_stands_after_some_seconds_and_moves_again() -> None:
    moving, standing = [], []
    for time_s, movers, stands in follow(MoverTracker(), stop_and_go, until_s=11.0):
        moving += [time_s] * bool(movers)
        standing += [time_s] * stands
    assert min(moving) < 1.3
    pause = [time_s for time_s in moving if 2.0 < time_s < 9.0]
    assert 2.0 + STAYS_S - 0.5 < max(pause) < 2.0 + STAYS_S + 1.0
    assert min(standing) == pytest.approx(max(pause) + STEP_S)
    assert not [time_s for time_s in standing if time_s > 10.0]
    assert max(moving) > 10.8


def test_two_that_cross_keep_their_numbers() -> None:
    tracker, rng = MoverTracker(), np.random.default_rng(3)
    for step in range(40):
        time_s = step * STEP_S
        one, other = (2.6, -1.0 + 0.5 * time_s), (1.6, 1.0 - 0.5 * time_s)
        points = np.vstack([face(np.array(place), rng, 0.02) for place in (one, other)])
        tracker.follow(points, HERE_M, time_s)
        if step == 15:
            before = {mover.id: mover.x_m for mover in tracker.movers(time_s)}
    after = {mover.id: mover.x_m for mover in tracker.movers(time_s)}
    assert set(before) == set(after)
    assert len(after) == 2
    for number, x_m in after.items():
        assert x_m == pytest.approx(before[number], abs=0.2)


def test_a_wall_and_a_speck_are_nothing() -> None:
    wall = np.column_stack([np.full(40, 2.0), np.linspace(-1.5, 1.5, 40)])
    tracker = MoverTracker()
    for step in range(20):
        shifted = wall + np.array([0.0, 0.05 * step])
        tracker.follow(np.vstack([shifted, [[0.5, 0.05 * step]]]), HERE_M, step * STEP_S)
        assert not len(tracker.places_m())


def test_what_is_seen_not_to_be_there_is_forgotten() -> None:
    tracker = MoverTracker()
    views = list(follow(tracker, lambda s: (2.0, -1.2 + 0.5 * s), until_s=2.0))
    time_s, movers, _ = views[-1]
    assert len(movers) == 1
    for step in range(1, 6):
        tracker.forget_free(np.ones(len(tracker.places_m()), dtype=bool), time_s + step * STEP_S)
    assert tracker.movers(time_s) == ()


def test_a_mover_in_view_owns_its_points_and_a_lost_one_none() -> None:
    tracker = MoverTracker()
    *_, (time_s, (mover,), _) = follow(tracker, lambda s: (2.0, -1.2 + 0.5 * s), until_s=2.0)
    assert tracker.owns(np.array([[mover.x_m, mover.y_m]])).all()
    tracker.predict(time_s + 3.0)
    ahead_m = [[mover.x_m, mover.y_m + 0.5 * passed_s] for passed_s in (0.0, 1.0, 2.0, 3.0)]
    assert not tracker.owns(np.array(ahead_m)).any()


def test_a_mover_too_far_away_to_be_a_lost_one_is_another() -> None:
    tracker = MoverTracker()
    *_, (time_s, _, _) = follow(tracker, lambda s: (2.0, -1.5 + 0.5 * s), until_s=2.0)
    for step in range(1, 36):
        now_s = time_s + step * STEP_S
        middle_m = np.array([2.0, 4.0 - 0.7 * STEP_S * step])
        tracker.follow(face(middle_m, np.random.default_rng(step), 0.02), HERE_M, now_s)
    assert len(tracker.movers(now_s)) == 2


def test_a_mover_may_be_where_it_is_and_out_of_view_anywhere() -> None:
    tracker = MoverTracker()
    *_, (time_s, (mover,), _) = follow(tracker, lambda s: (2.0, -1.2 + 0.5 * s), until_s=2.0)
    places_m = [np.array([mover.x_m, mover.y_m + off_m]) for off_m in (0.0, 1.0, 4.0)]
    assert [tracker.may_be_at(place_m, time_s) for place_m in places_m] == [True, False, False]
    assert all(tracker.may_be_at(place_m, time_s + 0.5) for place_m in places_m)


def test_what_slides_while_nothing_is_judged_is_no_mover_when_it_leaves_the_view() -> None:
    tracker = MoverTracker()
    for step in range(8):
        points_m = face(np.array([0.9 - 0.03 * step, 0.0]), np.random.default_rng(step), 0.0)
        tracker.follow(points_m, HERE_M, step * STEP_S, judges=False)
    for step in range(8, 14):
        tracker.follow(np.empty((0, 2)), HERE_M, step * STEP_S, judges=False)
    assert tracker.movers(14 * STEP_S) == ()


def test_the_first_whole_view_of_a_cluster_begins_its_time_of_standing() -> None:
    """The end of the view cut it off before, so that its place was uncertain."""
    tracker = MoverTracker()
    for step in range(29):
        points_m = face(np.array([2.0, 1.0]), np.random.default_rng(step), 0.0)
        cut = np.ones(len(points_m), dtype=bool)
        tracker.follow(points_m, HERE_M, step * STEP_S, cut=cut)
    for step in range(29, 34):
        points_m = face(np.array([2.0, 0.9]), np.random.default_rng(step), 0.0)
        assert not tracker.follow(points_m, HERE_M, step * STEP_S).any()


# --- on exact views -------------------------------------------------------------------------------

CAMERA = anafi_camera(640, 360).resized(224, 112)
PITCH_RAD = math.radians(-42)
HEIGHT_M = 1.5
SIDE_M = 0.4
BOX_M, BOX_ID = (1.6, -1.0), BOXES[2]
CART_ID = BOXES[4]


def class_ids(
    cart_m: tuple[float, float] | None, height_m: float = HEIGHT_M, *, box: bool = True
) -> NDArray[np.uint8]:
    """Return the view of a drone at (-1, 0): endless ground, a box and the cart."""
    rows, columns = np.indices((112, 224))
    right = (columns - CAMERA.cx_px) / CAMERA.fx_px
    below = (rows - CAMERA.cy_px) / CAMERA.fy_px
    forward = math.cos(PITCH_RAD) + math.sin(PITCH_RAD) * below
    down = math.cos(PITCH_RAD) * below - math.sin(PITCH_RAD)
    lens = np.array([-1.0 + CAMERA.forward_offset_m, 0.0, 0.0])
    rays = np.stack([forward, right, down], axis=-1)
    nearest = np.where(down > 0.0, height_m / np.maximum(down, 1e-9), math.inf)
    ids = np.where(down > 0.0, CARPET, 0).astype(np.uint8)
    things = [(BOX_M, BOX_ID)] * box + ([] if cart_m is None else [(cart_m, CART_ID)])
    for (x_m, y_m), class_id in things:
        low = np.array([x_m - SIDE_M / 2, y_m - SIDE_M / 2, 0.0]) - lens
        high = np.array([x_m + SIDE_M / 2, y_m + SIDE_M / 2, height_m]) - lens
        with np.errstate(divide="ignore"):
            ends = np.stack([low / rays, high / rays])
        enters, leaves = ends.min(axis=0).max(axis=-1), ends.max(axis=0).min(axis=-1)
        hit = (enters <= leaves) & (leaves > 0.0) & (enters < nearest)
        ids[hit], nearest[hit] = class_id, enters[hit]
    return ids


def mapped(
    places: Sequence[tuple[float, float] | None],
    mapper: SiteMapper,
    height_m: float = HEIGHT_M,
    *,
    box: bool = True,
) -> Iterator[SiteMap]:
    """Yield the map after each view of a drone that hovers, 0.1 s apart."""
    for index, place in enumerate(places):
        time_s = index * STEP_S
        pose = OdometryPose(time_s=time_s, x_m=-1.0, y_m=0.0, yaw_rad=0.0)
        still = BodyVelocity()
        motion = MotionEstimate(pose=pose, seen=pose, velocity=still, error=still, tracked_s=time_s)
        mapper.follow(motion)
        frame = values.frame((4, 8), PITCH_RAD, height_m, captured_s=time_s, index=index)
        class_map = paper_map(ids=class_ids(place, height_m, box=box), captured_s=time_s)
        view = View.of(class_map, frame, CAMERA, pose)
        assert view is not None
        mapper.add(view)
        yield mapper.map(motion)


def crossing(speed_mps: float = 0.5) -> list[tuple[float, float] | None]:
    return [(0.8, -1.1 + speed_mps * STEP_S * step) for step in range(36)]


def near(points_m: Floats, x_m: float, y_m: float, reach_m: float = 0.35) -> int:
    """Return how many points of a map lie around a place."""
    return int((np.hypot(*(points_m - (x_m, y_m)).T) < reach_m).sum())


def test_a_cart_that_crosses_the_view_is_a_mover_and_not_in_the_map() -> None:
    """It comes out of nowhere onto ground that was seen: nothing of it stands, the box does."""
    maps = list(mapped([None] * 4 + crossing(), SiteMapper(CLASSES)))
    found = maps[-1]
    (mover,) = found.movers
    assert math.dist((mover.x_m, mover.y_m), (0.8, 0.65)) < 0.25
    assert math.hypot(mover.x_mps, mover.y_mps - 0.5) < 0.15
    assert near(found.obstacles_m, *BOX_M) >= 3
    assert near(found.obstacles_m, 0.8, 0.0, 0.6) == 0
    assert not [thing for thing in found.objects if thing.class_id == CART_ID]


@pytest.mark.parametrize("box", [True, False])
def test_a_cart_that_comes_below_the_view_is_a_mover(*, box: bool) -> None:
    """Also where nothing else is in view, so that the view has no bases at all."""
    comes = [(0.35 - 0.03 * step, 0.0) for step in range(20)]
    maps = list(mapped([None] * 4 + comes, SiteMapper(CLASSES), box=box))
    assert any(found.movers for found in maps)


def test_a_restart_of_the_map_keeps_in_mind_that_something_moved() -> None:
    mapper = SiteMapper(CLASSES)
    before = list(mapped([None] * 4 + crossing(), mapper))[-1]
    mapper.restart()
    after = next(iter(mapped([None], mapper)))
    assert before.movers
    assert after.movers == ()
    assert after.moved_s == before.moved_s > 0.0


def test_what_stood_and_moves_off_leaves_the_map() -> None:
    stands: list[tuple[float, float] | None] = [(0.8, -0.6)] * 25
    maps = list(
        mapped(stands + [(0.8, -0.6 + 0.05 * step) for step in range(28)], SiteMapper(CLASSES))
    )
    assert near(maps[24].obstacles_m, 0.8, -0.6) >= 4
    assert not maps[24].movers
    assert len(maps[-1].movers) == 1
    assert near(maps[-1].obstacles_m, 0.8, -0.6) == 0


def test_what_stops_on_ground_seen_before_stands_in_the_map() -> None:
    arrives = [place for place in crossing() if place is not None and place[1] <= 0.0]
    stays: list[tuple[float, float] | None] = [arrives[-1]] * 50
    maps = list(mapped([None] * 4 + [*arrives, *stays], SiteMapper(CLASSES)))
    assert max(len(found.movers) for found in maps) == 1
    assert not maps[-1].movers
    assert near(maps[-1].obstacles_m, *arrives[-1]) >= 4


def test_where_something_moved_is_known_until_the_ground_there_is_seen_again() -> None:
    """It left the view at the side: beyond that nobody has looked, before it everything is seen."""
    leaves = [(0.8, -0.4 + 0.05 * step) for step in range(36)]
    maps = list(mapped([None] * 4 + leaves + [None] * 10, SiteMapper(CLASSES)))
    lane_m = maps[-1].lanes_m
    assert len(lane_m)
    assert lane_m[:, 1].min() > 0.4
    assert np.abs(lane_m[:, 0] - 0.8).max() < 0.4


@pytest.mark.parametrize("moved", [True, False])
def test_what_has_arrived_and_waits_may_move_on(*, moved: bool) -> None:
    """Once anything has moved in a place, what stands on ground seen before is kept away from."""
    before = crossing() + [None] * 30 if moved else [None] * 66
    waits: list[tuple[float, float] | None] = [(1.7, 0.5)] * 20
    found = list(mapped([None] * 4 + before + waits, SiteMapper(CLASSES)))[-1]
    assert not found.movers
    assert (near(found.lanes_m, 1.7, 0.5) >= 4) == moved


def test_a_place_without_movers_has_none() -> None:
    for found in mapped([(0.8, -0.6)] * 40, SiteMapper(CLASSES)):
        assert found.movers == ()
        assert not len(found.lanes_m)


@pytest.mark.parametrize(("height_m", "movers"), [(0.9, 0), (HEIGHT_M, 1)])
def test_nothing_is_judged_to_move_from_low_down(height_m: float, movers: int) -> None:
    """A decimetre that the height is off there lets what stands slide."""
    views = mapped([None] * 4 + crossing(), SiteMapper(CLASSES), height_m)
    assert max(len(found.movers) for found in views) == movers


def test_what_waits_is_kept_away_from_for_as_long_as_movers_pause() -> None:
    tracker = MoverTracker()
    *_, (time_s, movers, _) = follow(tracker, lambda s: (2.0, -1.2 + 0.5 * s), until_s=2.0)
    assert movers
    for later_s, may_move in [(WAITS_S - 1.0, True), (WAITS_S + 1.0, False)]:
        for step in range(10):
            seen_s = time_s + later_s + step * STEP_S
            place = np.array([[1.0, 1.0], [1.0, 1.1], [1.1, 1.0]])
            tracker.follow(place, np.zeros(2), seen_s)
        assert bool(len(tracker.may_move_m(seen_s))) == may_move


def test_a_mover_that_stopped_may_go_on_out_of_view() -> None:
    tracker = MoverTracker()
    (*_, (time_s, movers, stands)) = follow(tracker, stop_and_go, until_s=8.5)
    assert stands
    assert movers == ()
    assert tracker.movers(time_s + 0.5) == ()
    (lost,) = tracker.movers(time_s + 2.0)
    assert lost.std_m > 0.8
