"""The mark's track: latency, gating, doubt, heading."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from perception.marks.tracker import MarkTracker, MarkTrackerConfig
from tests.uav_bt.types.circle_flight import TICK_S, Flight, state
from uav_bt.errors import ValueRangeError
from uav_bt.landing_marks import MarkSighting
from uav_bt.types import MarkFix


def see(
    tracker: MarkTracker, forward_m: float, right_m: float, *, captured_s: float, confidence: float
) -> bool:
    """Give the tracker a sighting of a mark that shows no heading."""
    sighting = MarkSighting(
        forward_m=forward_m, right_m=right_m, height_m=0.2, confidence=confidence
    )
    return tracker.update(sighting, captured_s=captured_s)


def known(fix: MarkFix | None) -> MarkFix:
    assert fix is not None
    return fix


# --- the track ------------------------------------------------------------------------------------


def test_nothing_is_known_before_a_detection() -> None:
    """Telemetry alone gives no fix; a detection before any telemetry cannot be placed."""
    tracker = MarkTracker()

    assert not see(tracker, 1.0, 0.0, captured_s=0.0, confidence=1.0)
    tracker.predict(state(0.1))
    assert tracker.fix(detected=False) is None


def test_the_first_detection_is_the_fix() -> None:
    """Place, capture time and confidence are those of the detection."""
    tracker = MarkTracker()
    tracker.predict(state(0.3, yaw_rad=1.1))

    assert see(tracker, 2.0, -0.5, captured_s=0.3, confidence=0.8)
    fix = known(tracker.fix(detected=True))

    assert (fix.forward_m, fix.right_m) == pytest.approx((2.0, -0.5))
    assert (fix.captured_s, fix.confidence, fix.detected) == (0.3, 0.8, True)
    assert fix.std_m > 0.06


@pytest.mark.parametrize("rate", [1e-6, 0.7, -1.0])
def test_the_fix_stands_still_while_the_drone_moves(rate: float) -> None:
    """Unseen for three seconds of flying and turning, the pad is still where it was."""
    flight, tracker = Flight(0.45, rate), MarkTracker()
    pad = flight.pose(0.0).to_world(2.5, 0.3)
    tracker.predict(flight.state(0.0))
    see(tracker, 2.5, 0.3, captured_s=0.0, confidence=1.0)

    for tick in range(1, 31):
        tracker.predict(flight.state(TICK_S * tick))

    fix = known(tracker.fix(detected=False))
    assert (fix.forward_m, fix.right_m) == pytest.approx(flight.pose(3.0).to_body(*pad), abs=0.02)
    assert fix.captured_s == 0.0


def test_a_late_frame_counts_from_where_it_was_captured() -> None:
    """Turning at 1 rad/s, a frame 0.25 s old would be off by 0.6 m if it counted from now."""
    flight, tracker = Flight(0.3, 1.0), MarkTracker()
    pad = flight.pose(0.0).to_world(2.5, 0.0)
    for tick in range(11):
        tracker.predict(flight.state(TICK_S * tick))
    captured_s = 0.75
    seen = flight.pose(captured_s).to_body(*pad)

    see(tracker, *seen, captured_s=captured_s, confidence=1.0)
    fix = known(tracker.fix(detected=True))

    truth = flight.pose(1.0).to_body(*pad)
    assert math.dist(seen, truth) > 0.6
    assert (fix.forward_m, fix.right_m) == pytest.approx(truth, abs=0.01)


def _noisy_track(
    place: Callable[[float], tuple[float, float]], count: int, confidence: float = 1.0
) -> MarkTracker:
    tracker = MarkTracker()
    for tick in range(count):
        tracker.predict(state(TICK_S * tick))
        see(tracker, *place(TICK_S * tick), captured_s=TICK_S * tick, confidence=confidence)
    return tracker


def test_noise_averages_out() -> None:
    """Forty noisy detections give a better fix than one, and the filter knows it."""
    generator = np.random.default_rng(3)
    std = 0.06 * 2.0

    tracker = _noisy_track(lambda _: (2.0 + std * generator.standard_normal(), 0.0), 40)
    fix = known(tracker.fix(detected=True))

    assert fix.forward_m == pytest.approx(2.0, abs=0.06)
    assert fix.std_m < 0.06


def test_uncertainty_grows_while_unseen() -> None:
    """Dead reckoning drifts: each unseen second adds to the variance."""
    tracker = _noisy_track(lambda _: (2.0, 0.0), 20)
    before = known(tracker.fix(detected=True)).std_m

    for tick in range(20, 60):
        tracker.predict(state(TICK_S * tick))
    after = known(tracker.fix(detected=False)).std_m

    assert after**2 - before**2 == pytest.approx(0.05**2 * 4.0, rel=1e-6)


def test_range_is_trusted_less_than_bearing() -> None:
    """Far away, an error along the line of sight is forgiven where one across it is rejected."""
    along, across = (_noisy_track(lambda _: (4.0, 0.0), 3) for _ in range(2))

    assert see(along, 4.6, 0.0, captured_s=0.2, confidence=1.0)
    assert not see(across, 4.0, 0.6, captured_s=0.2, confidence=1.0)


def test_the_line_of_sight_turns_with_the_heading() -> None:
    """The same at another heading, where the line of sight lies along the odometry's y."""
    along, across = MarkTracker(), MarkTracker()
    for tracker in (along, across):
        for tick in range(3):
            tracker.predict(state(TICK_S * tick, yaw_rad=math.pi / 2))
            see(tracker, 4.0, 0.0, captured_s=TICK_S * tick, confidence=1.0)

    assert see(along, 4.6, 0.0, captured_s=0.2, confidence=1.0)
    assert not see(across, 4.0, 0.6, captured_s=0.2, confidence=1.0)


def test_an_outlier_leaves_the_track_alone() -> None:
    """A detection metres away is refused; fix, age and confidence stay."""
    tracker = _noisy_track(lambda _: (2.0, 0.0), 10)
    before = known(tracker.fix(detected=True))

    assert not see(tracker, 3.5, 1.5, captured_s=0.9, confidence=0.5)

    assert tracker.fix(detected=True) == before


def test_many_outliers_in_a_row_move_the_track() -> None:
    """If they keep coming the track was wrong: it begins again at the next one."""
    tracker = _noisy_track(lambda _: (2.0, 0.0), 10)
    answers = [
        see(tracker, 3.5, 1.5, captured_s=1.0 + TICK_S * tick, confidence=0.9) for tick in range(6)
    ]

    assert answers == [False] * 5 + [True]
    fix = known(tracker.fix(detected=True))
    assert (fix.forward_m, fix.right_m) == pytest.approx((3.5, 1.5))


def test_scattered_outliers_never_add_up() -> None:
    """A good detection in between ends the count."""
    tracker = _noisy_track(lambda _: (2.0, 0.0), 10)
    for _ in range(5):
        for _ in range(4):
            assert not see(tracker, 3.5, 1.5, captured_s=0.9, confidence=1.0)
        assert see(tracker, 2.0, 0.0, captured_s=0.9, confidence=1.0)

    fix = known(tracker.fix(detected=True))
    assert (fix.forward_m, fix.right_m) == pytest.approx((2.0, 0.0), abs=0.01)


def test_doubtful_detections_move_the_track_less() -> None:
    """The same shifted detection pulls less with half the confidence."""

    def shift(confidence: float) -> float:
        tracker = _noisy_track(lambda _: (1.0, 0.0), 5)
        assert see(tracker, 1.1, 0.0, captured_s=0.4, confidence=confidence)
        return known(tracker.fix(detected=True)).forward_m - 1.0

    assert 0.0 < shift(0.5) < 0.5 * shift(1.0)


def test_an_older_detection_does_not_age_the_fix() -> None:
    """Frames may come out of order; the fix keeps the newest capture time."""
    tracker = _noisy_track(lambda _: (2.0, 0.0), 10)

    see(tracker, 2.0, 0.0, captured_s=0.4, confidence=1.0)

    assert known(tracker.fix(detected=True)).captured_s == pytest.approx(0.9)


def test_forgetting_keeps_the_odometry() -> None:
    """The track is gone; a detection made before the forgetting can still be placed right."""
    tracker = MarkTracker()
    for tick in range(11):
        tracker.predict(state(TICK_S * tick, forward_mps=0.5))
    see(tracker, 2.0, 0.0, captured_s=1.0, confidence=1.0)

    tracker.forget()
    assert tracker.fix(detected=False) is None

    see(tracker, 2.0, 0.0, captured_s=0.6, confidence=1.0)
    fix = known(tracker.fix(detected=True))
    assert fix.forward_m == pytest.approx(1.8)
    assert fix.captured_s == pytest.approx(0.6)


@pytest.mark.parametrize(
    ("forward_m", "right_m", "captured_s", "confidence"),
    [
        (math.nan, 0.0, 0.0, 1.0),
        (1.0, math.inf, 0.0, 1.0),
        (1.0, 0.0, math.nan, 1.0),
        (1.0, 0.0, 0.0, 1.5),
        (1.0, 0.0, 0.0, -0.1),
        (1.0, 0.0, 0.0, math.nan),
    ],
)
def test_refuses_what_is_no_detection(
    forward_m: float, right_m: float, captured_s: float, confidence: float
) -> None:
    """One bad number would poison the filter for good: it is refused, and the track stays."""
    tracker = _noisy_track(lambda _: (2.0, 0.0), 3)
    before = tracker.fix(detected=True)

    with pytest.raises(ValueRangeError, match="must be finite"):
        see(tracker, forward_m, right_m, captured_s=captured_s, confidence=confidence)

    assert tracker.fix(detected=True) == before


def test_the_noise_model_is_configurable() -> None:
    """A wide gate accepts detections that the default rejects."""
    tracker = MarkTracker(MarkTrackerConfig(gate=1e6))
    tracker.predict(state(0.0))
    see(tracker, 2.0, 0.0, captured_s=0.0, confidence=1.0)

    assert see(tracker, 3.5, 1.5, captured_s=0.0, confidence=1.0)


# --- heading --------------------------------------------------------------------------------------


def _seen_at(heading_deg: float | None) -> MarkSighting:
    return MarkSighting(forward_m=2.0, right_m=0.0, height_m=0.0, heading_deg=heading_deg)


def test_the_heading_turns_with_the_drone() -> None:
    """Seen at 30 degrees, and then turned by 20 clockwise without a view: 50 degrees."""
    tracker = MarkTracker()
    tracker.predict(state(0.0))
    tracker.update(_seen_at(30.0), captured_s=0.0)

    tracker.predict(state(0.1, yaw_rad=math.radians(20.0)))

    assert known(tracker.fix(detected=False)).heading_deg == pytest.approx(50.0)


def test_a_mark_that_shows_no_heading_has_none() -> None:
    tracker = MarkTracker()
    tracker.predict(state(0.0))
    tracker.update(_seen_at(None), captured_s=0.0)

    assert known(tracker.fix(detected=True)).heading_deg is None


def test_headings_average_across_the_half_turn() -> None:
    """179 and -179 degrees are two degrees apart; their mean is 180, not 0."""
    tracker = MarkTracker()
    for index, heading_deg in enumerate((179.0, -179.0)):
        tracker.predict(state(TICK_S * index))
        tracker.update(_seen_at(heading_deg), captured_s=TICK_S * index)

    heading_deg = known(tracker.fix(detected=True)).heading_deg
    assert heading_deg is not None
    assert abs(heading_deg) == pytest.approx(180.0, abs=0.1)


def test_a_wrong_heading_is_an_outlier_until_it_stays() -> None:
    tracker = MarkTracker()
    headings: list[float | None] = []
    for index in range(12):
        tracker.predict(state(TICK_S * index))
        tracker.update(_seen_at(0.0 if index < 5 else 90.0), captured_s=TICK_S * index)
        headings.append(known(tracker.fix(detected=True)).heading_deg)

    assert headings[5] == pytest.approx(0.0, abs=0.1)
    assert headings[-1] == pytest.approx(90.0, abs=1.0)
