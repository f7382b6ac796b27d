"""What moves: sightings with the noise of depth and odometry, and exact views of the twin's lab."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest

from perception.mapping.mover_track import STAYS_S
from perception.mapping.movers import LIFE_S, TURNED_RATIO, WAITS_S, MoverTracker, are_of_known
from tests.perception.mapping.mapping_world import points
from uav_bt.types.arrays import Floats
from uav_bt.types.site_map import MapMover

Place = tuple[float, float]
Path = Callable[[float], Place]
Views = Iterator[tuple[float, tuple[MapMover, ...], bool]]
STEP_S = 0.1
RADIUS_M = 0.2
HERE_M = np.array([0.0, 0.0])
NOTHING = np.empty((0, 2))


def face(middle_m: Sequence[float], rng: np.random.Generator, drift_m: float) -> Floats:
    """Return the bases of a cylinder as they are seen from `HERE_M`, some centimetres off.

    A view errs as a whole by the odometry's noise, each point by that of its pixel.
    """
    towards = math.atan2(*(HERE_M - middle_m)[::-1])
    angles = towards + np.linspace(-1.2, 1.2, 9)
    arc = middle_m + RADIUS_M * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return np.asarray(arc + rng.normal(0.0, drift_m, 2) + rng.normal(0.0, 0.03, arc.shape))


def follow(
    tracker: MoverTracker,
    path: Path,
    *,
    until_s: float,
    drift_m: float = 0.03,
    seed: int = 0,
) -> Views:
    """Yield time, movers, and whether all of the thing's points stand, view by view."""
    rng = np.random.default_rng(seed)
    for step in range(round(until_s / STEP_S)):
        time_s = step * STEP_S
        stands = tracker.follow(face(path(time_s), rng, drift_m), HERE_M, time_s)
        yield time_s, tracker.movers(time_s), bool(stands.all())


def crossed(until_s: float = 2.0) -> tuple[MoverTracker, float, MapMover]:
    """Return a tracker of a mover that crosses, the time of the last view, and the mover."""
    tracker = MoverTracker()
    *_, (time_s, (mover,), _) = follow(tracker, lambda s: (2.0, -1.2 + 0.5 * s), until_s=until_s)
    return tracker, time_s, mover


def approach(tracker: MoverTracker, speed_mps: float, until_s: float, seed: int) -> Views:
    return follow(
        tracker, lambda s: (1.2 - speed_mps * s, 0.0), until_s=until_s, drift_m=0.01, seed=seed
    )


JUMPS_M = 0.25 * np.random.default_rng(0).integers(-1, 2, (200, 2))


@pytest.mark.parametrize(
    ("path", "until_s"),
    [
        pytest.param(lambda _: (2.0, 0.5), 60.0, id="noise"),
        # A correction of the map's drift moves all that is seen by a decimetre, again and again.
        pytest.param(lambda s: (2.0 + 0.1 * (s // 4 % 2), 0.5 + 0.01 * s), 15.0, id="drift"),
        # The base jumps between the legs of a chair, and on to the shadow of its seat.
        pytest.param(lambda s: JUMPS_M[round(s / STEP_S)] + (1.8, 0.0), 20.0, id="chair"),
    ],
)
def test_a_box_seen_again_and_again_is_no_mover(path: Path, until_s: float) -> None:
    for seed in range(4):
        for _, movers, _ in follow(MoverTracker(), path, until_s=until_s, seed=seed):
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


@pytest.mark.parametrize("cut", [True, False])
def test_a_wide_thing_that_shows_one_part_after_another_is_no_mover(*, cut: bool) -> None:
    """The drone passes a table at 0.25 m/s: what its view shows slides along the edge."""
    tracker = MoverTracker()
    side_m = np.column_stack([np.full(45, 1.5), np.linspace(-0.8, 0.8, 45)])
    for step in range(16):
        points_m = side_m[step * 5 // 7 :][: 20 if cut else 28]
        ends = np.isin(np.arange(len(points_m)), [0, len(points_m) - 1])
        tracker.follow(points_m, HERE_M, step * STEP_S, cut=cut & ends)
    for time_s in (1.6, 1.7, 1.8, 1.9):
        tracker.follow(NOTHING, HERE_M, time_s)
        assert tracker.movers(time_s) == ()


def test_an_edge_above_the_ground_seen_by_a_drone_that_passes_is_no_mover() -> None:
    """The edge seems to move against the drone, at up to two thirds of its speed."""
    tracker = MoverTracker()
    for step in range(30):
        here_m = np.array([0.0, 0.05 * step])
        points_m = face((2.0, 0.5 - 0.6 * here_m[1]), np.random.default_rng(step), 0.01)
        tracker.follow(points_m, here_m, step * STEP_S)
        assert tracker.movers(step * STEP_S) == ()


def test_what_is_low_stands_unless_it_moved_before() -> None:
    """A chair shows one leg after another, and the edge of its seat."""
    tracker, low = MoverTracker(), np.zeros(9, dtype=bool)
    for step in range(40):
        points_m = face((2.0, -1.0 + 0.05 * step), np.random.default_rng(step), 0.01)
        assert tracker.follow(points_m, HERE_M, step * STEP_S, tall=low).all()
        assert tracker.movers(step * STEP_S) == ()
    tracker, time_s, mover = crossed()
    points_m = face((mover.x_m, mover.y_m), np.random.default_rng(0), 0.01)
    assert not tracker.follow(points_m, HERE_M, time_s + STEP_S, tall=low).any()


def test_what_shows_near_an_old_point_of_its_class_is_of_that_obstacle() -> None:
    known, seen = points((0.0, 0.0)), points((0.25, 0.0), (0.35, 0.0))
    assert are_of_known(seen, known, 6.0).tolist() == [True, False]
    assert not are_of_known(seen, known, 4.0).any()
    assert not are_of_known(replace(seen, ids=seen.ids + 1), known, 6.0).any()


@pytest.mark.parametrize("speed_mps", [0.2, 0.5, 1.0])
@pytest.mark.parametrize("seed", range(4))
def test_a_cart_that_crosses_is_a_mover_soon_with_its_velocity(speed_mps: float, seed: int) -> None:
    def path(time_s: float) -> Place:
        return 2.0, -1.2 + speed_mps * time_s

    views = list(follow(MoverTracker(), path, until_s=min(2.4 / speed_mps, 6.0), seed=seed))
    time_s, (mover,), _ = views[-1]
    assert min(seen_s for seen_s, movers, _ in views if movers) <= 0.5 + 0.45 / speed_mps
    assert math.hypot(mover.x_mps, mover.y_mps - speed_mps) < 0.12
    assert math.dist((mover.x_m, mover.y_m), path(time_s)) < 0.2
    assert mover.speed_mps == pytest.approx(speed_mps, abs=0.12)
    ahead = mover.at(np.array([0.0, 2.0]))
    assert math.dist(ahead[1], ahead[0]) == pytest.approx(2.0 * mover.speed_mps)


@pytest.mark.parametrize("speed_mps", [0.0, 0.25, 0.3, 0.35])
def test_what_comes_below_the_view_before_it_is_confirmed_is_a_mover(speed_mps: float) -> None:
    """It comes towards the drone for 0.8 s; a box for as long is none."""
    for seed in range(8):
        tracker = MoverTracker()
        list(approach(tracker, speed_mps, 0.8, seed))
        for time_s in (0.8, 0.9, 1.0, 1.1):
            tracker.follow(NOTHING, HERE_M, time_s)
        assert len(tracker.movers(1.1)) == (speed_mps > 0.0)


@pytest.mark.parametrize("speed_mps", [0.0, 0.35])
def test_near_the_camera_a_mover_is_confirmed_sooner(speed_mps: float) -> None:
    for seed in range(8):
        views = approach(MoverTracker(), speed_mps, 1.0, seed)
        first_s = min((time_s for time_s, movers, _ in views if movers), default=math.inf)
        assert first_s <= 0.8 if speed_mps else first_s == math.inf


def test_out_of_view_a_mover_goes_on_may_have_turned_and_is_forgotten() -> None:
    """After a while it is anywhere within the way that it covers from its last place."""
    tracker, time_s, seen = crossed(3.0)
    place_m = seen.x_m, seen.y_m
    ahead_m = np.array([(seen.x_m, seen.y_m + off_m) for off_m in (0.0, 1.0, 4.0)])
    assert tracker.owns(ahead_m).tolist() == [True, False, False]
    assert [tracker.may_be_at(each_m, time_s) for each_m in ahead_m] == [True, False, False]
    assert all(tracker.may_be_at(each_m, time_s + 0.5) for each_m in ahead_m)
    stds = [seen.std_m]
    for step in range(1, round(LIFE_S / STEP_S)):
        tracker.follow(NOTHING, HERE_M, time_s + step * STEP_S)
        (lost,) = tracker.movers(time_s + step * STEP_S)
        stds.append(lost.std_m)
        if step == 30:
            assert math.dist((lost.x_m, lost.y_m), place_m) < 0.1
            assert lost.speed_mps == 0.0
            assert lost.std_m == pytest.approx(3.0 * 0.5 * TURNED_RATIO, rel=0.2)
            assert tracker.places_m() == pytest.approx(np.array([[lost.x_m, lost.y_m]]))
            assert not tracker.owns(np.array([place_m, (seen.x_m, seen.y_m + 1.5)])).any()
    assert stds == sorted(stds)
    tracker.follow(NOTHING, HERE_M, time_s + LIFE_S + 0.15)
    assert tracker.movers(time_s + LIFE_S + 0.15) == ()


@pytest.mark.parametrize(
    ("until_s", "unseen", "seen", "y_m", "speed_mps", "movers"),
    [
        pytest.param(3.0, 20, 15, 1.2, 0.5, 1, id="it turned out of view"),
        pytest.param(2.0, 0, 35, 4.0, -0.7, 2, id="too far away to be the lost one"),
    ],
)
def test_the_place_where_a_mover_was_lost_is_dropped_once_it_is_found_again(
    *, until_s: float, unseen: int, seen: int, y_m: float, speed_mps: float, movers: int
) -> None:
    tracker, time_s, _ = crossed(until_s)
    for step in range(1, unseen + 1):
        tracker.follow(NOTHING, HERE_M, time_s + step * STEP_S)
    for step in range(1, seen + 1):
        now_s = time_s + (unseen + step) * STEP_S
        place_m = 2.0, y_m + speed_mps * step * STEP_S
        tracker.follow(face(place_m, np.random.default_rng(step), 0.02), HERE_M, now_s)
    found = tracker.movers(now_s)
    assert len(found) == movers
    assert found[-1].y_m == pytest.approx(place_m[1], abs=0.2)
    assert tracker.moved_s == now_s


def test_a_mover_that_stops_stands_after_some_seconds_and_moves_again() -> None:
    """It moves for 2 s at 0.6 m/s, stands for 7 s, and moves on. Out of view it may go on."""

    def path(time_s: float) -> Place:
        return 2.0, -1.2 + 0.6 * (min(time_s, 2.0) + max(time_s - 9.0, 0.0))

    tracker, moving, standing = MoverTracker(), [], []
    for time_s, movers, stands in follow(tracker, path, until_s=11.0):
        moving += [time_s] * bool(movers)
        standing += [time_s] * stands
        if time_s == 85 * STEP_S:
            assert stands
            assert movers == tracker.movers(time_s + 0.5) == ()
            (lost,) = tracker.movers(time_s + 2.0)
            assert lost.std_m > 0.8
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
        points = np.vstack([face(place, rng, 0.02) for place in (one, other)])
        tracker.follow(points, HERE_M, time_s)
        if step == 15:
            before = {mover.id: mover.x_m for mover in tracker.movers(time_s)}
    after = {mover.id: mover.x_m for mover in tracker.movers(time_s)}
    assert len(after) == 2
    assert after == pytest.approx(before, abs=0.2)


def test_a_wall_and_a_speck_are_nothing() -> None:
    wall = np.column_stack([np.full(40, 2.0), np.linspace(-1.5, 1.5, 40)])
    tracker = MoverTracker()
    for step in range(20):
        points_m = np.vstack([wall, [[0.5, 0.0]]]) + np.array([0.0, 0.05 * step])
        tracker.follow(points_m, HERE_M, step * STEP_S)
        assert not len(tracker.places_m())


def test_what_is_seen_not_to_be_there_is_forgotten() -> None:
    tracker, time_s, _ = crossed()
    for step in range(1, 6):
        tracker.forget_free(np.ones(len(tracker.places_m()), dtype=bool), time_s + step * STEP_S)
    assert tracker.movers(time_s) == ()


def test_what_slides_while_nothing_is_judged_is_no_mover_when_it_leaves_the_view() -> None:
    tracker = MoverTracker()
    for step in range(14):
        points_m = face((0.9 - 0.03 * step, 0.0), np.random.default_rng(step), 0.0)
        points_m = points_m if step < 8 else NOTHING
        tracker.follow(points_m, HERE_M, step * STEP_S, judges=False)
    assert tracker.movers(14 * STEP_S) == ()


def test_the_first_whole_view_of_a_cluster_begins_its_time_of_standing() -> None:
    """The end of the view cut it off before, so that its place was uncertain."""
    tracker = MoverTracker()
    for step in range(34):
        cut = step < 29
        points_m = face((2.0, 1.0 if cut else 0.9), np.random.default_rng(step), 0.0)
        stands = tracker.follow(points_m, HERE_M, step * STEP_S, cut=np.full(len(points_m), cut))
        assert cut or not stands.any()


def test_what_waits_is_kept_away_from_for_as_long_as_movers_pause() -> None:
    tracker, time_s, _ = crossed()
    for later_s, may_move in [(WAITS_S - 1.0, True), (WAITS_S + 1.0, False)]:
        for step in range(10):
            seen_s = time_s + later_s + step * STEP_S
            tracker.follow(np.array([[1.0, 1.0], [1.0, 1.1], [1.1, 1.0]]), HERE_M, seen_s)
        assert bool(len(tracker.may_move_m(seen_s))) == may_move
