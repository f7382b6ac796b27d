"""The mark's track: latency, gating, doubt, heading."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from perception.marks.tracker import MarkTracker
from tests.uav_bt.types.circle_flight import TICK_S, Flight, state
from uav_bt.landing_marks import MarkSighting
from uav_bt.types import MarkFix


def see(
    tracker: MarkTracker, forward_m: float, right_m: float, *, captured_s: float, **more: Any
) -> bool:
    """Give the tracker a sighting; return whether it was accepted."""
    sighting = MarkSighting(forward_m=forward_m, right_m=right_m, height_m=0.2, **more)
    tracker.see(sighting, captured_s)
    fix = tracker.fix()
    return fix is not None and fix.detected


def known(tracker: MarkTracker) -> MarkFix:
    fix = tracker.fix()
    assert fix is not None
    return fix


def place(tracker: MarkTracker) -> tuple[float, float]:
    return known(tracker).forward_m, known(tracker).right_m


def tracking(
    count: int = 10, forward_m: float = 2.0, *, yaw_rad: float = 0.0, noise_m: float = 0.0
) -> MarkTracker:
    """Return a tracker that has seen the mark ahead in so many frames, hovering."""
    tracker, generator = MarkTracker(), np.random.default_rng(3)
    for tick in range(count):
        tracker.predict(state(TICK_S * tick, yaw_rad=yaw_rad))
        off_m = noise_m * generator.standard_normal()
        see(tracker, forward_m + off_m, 0.0, captured_s=TICK_S * tick)
    return tracker


def test_the_first_sighting_is_the_fix() -> None:
    """Without telemetry the mark is known only in frames that show it."""
    tracker = MarkTracker()
    assert tracker.fix() is None
    assert see(tracker, 1.0, 0.5, captured_s=0.2, confidence=0.7)
    assert place(tracker) == (1.0, 0.5)
    assert (known(tracker).captured_s, known(tracker).confidence) == (0.2, 0.7)
    tracker.see(None, 0.25)
    tracker.predict(state(0.3, yaw_rad=1.1))
    assert tracker.fix() is None
    assert see(tracker, 2.0, -0.5, captured_s=0.3, confidence=0.8)
    fix = known(tracker)
    assert place(tracker) == pytest.approx((2.0, -0.5))
    assert (fix.captured_s, fix.confidence, fix.detected, fix.height_m) == (0.3, 0.8, True, 0.2)
    assert fix.std_m > 0.06


@pytest.mark.parametrize("rate", [1e-6, 0.7, -1.0])
def test_the_fix_stands_still_while_the_drone_moves(rate: float) -> None:
    """Unseen for three seconds of flying and turning, the pad is still where it was."""
    flight, tracker = Flight(0.45, rate), MarkTracker()
    pad = flight.pose(0.0).to_world(2.5, 0.3)
    tracker.predict(flight.state(0.0))
    see(tracker, 2.5, 0.3, captured_s=0.0)
    for tick in range(1, 31):
        tracker.predict(flight.state(TICK_S * tick))
        tracker.see(None, TICK_S * tick)
    assert place(tracker) == pytest.approx(flight.pose(3.0).to_body(*pad), abs=0.02)
    assert (known(tracker).captured_s, known(tracker).detected) == (0.0, False)


def test_a_late_frame_counts_from_where_it_was_captured() -> None:
    """Turning at 1 rad/s, a frame 0.25 s old would be off by 0.6 m if it counted from now."""
    flight, tracker = Flight(0.3, 1.0), MarkTracker()
    pad = flight.pose(0.0).to_world(2.5, 0.0)
    for tick in range(11):
        tracker.predict(flight.state(TICK_S * tick))
    seen, truth = flight.pose(0.75).to_body(*pad), flight.pose(1.0).to_body(*pad)
    see(tracker, *seen, captured_s=0.75)
    assert math.dist(seen, truth) > 0.6
    assert place(tracker) == pytest.approx(truth, abs=0.01)


def test_noise_averages_out_and_the_uncertainty_grows_while_unseen() -> None:
    """The filter knows how good forty sightings are; each unseen second adds to the variance."""
    tracker = tracking(40, noise_m=0.12)
    assert known(tracker).forward_m == pytest.approx(2.0, abs=0.06)
    before = known(tracker).std_m
    assert before < 0.06
    for tick in range(40, 80):
        tracker.predict(state(TICK_S * tick))
    assert known(tracker).std_m ** 2 - before**2 == pytest.approx(0.05**2 * 4.0, rel=1e-6)


def test_outliers_leave_the_track_alone_until_they_stay() -> None:
    """Metres away they are refused: fix, age and confidence stay; the sixth begins a new track."""
    tracker = tracking()
    for index in range(25):  # a good sighting in between ends the count
        good = index % 5 == 4
        assert see(tracker, *((2.0, 0.0) if good else (3.5, 1.5)), captured_s=0.9) == good
    assert place(tracker) == pytest.approx((2.0, 0.0), abs=0.01)
    before = known(tracker)
    for tick in range(5):
        assert not see(tracker, 3.5, 1.5, captured_s=1.0 + TICK_S * tick, confidence=0.5)
        assert known(tracker) == replace(before, detected=False)
    assert see(tracker, 3.5, 1.5, captured_s=1.5, confidence=0.5)
    assert place(tracker) == pytest.approx((3.5, 1.5))


def test_doubtful_sightings_count_less_and_ranges_less_than_bearings() -> None:
    """The same shifted sighting pulls less with half the confidence."""
    shifts = []
    for confidence in (0.5, 1.0):
        tracker = tracking(5, 1.0)
        assert see(tracker, 1.1, 0.0, captured_s=0.4, confidence=confidence)
        shifts.append(known(tracker).forward_m - 1.0)
    assert 0.0 < shifts[0] < 0.5 * shifts[1]
    # Far away an error along the line of sight is forgiven where one across it is rejected.
    for yaw_rad in (0.0, math.pi / 2):
        assert see(tracking(3, 4.0, yaw_rad=yaw_rad), 4.6, 0.0, captured_s=0.2)
        assert not see(tracking(3, 4.0, yaw_rad=yaw_rad), 4.0, 0.6, captured_s=0.2)


def test_forgetting_keeps_the_odometry_and_a_late_frame_does_not_age_the_fix() -> None:
    """A sighting captured before the forgetting can still be placed right."""
    tracker = MarkTracker()
    for tick in range(11):
        tracker.predict(state(TICK_S * tick, forward_mps=0.5))
    see(tracker, 2.0, 0.0, captured_s=1.0, heading_deg=90.0)
    see(tracker, 2.2, 0.0, captured_s=0.6)
    assert known(tracker).captured_s == 1.0
    tracker.forget()
    assert tracker.fix() is None
    see(tracker, 2.0, 0.0, captured_s=0.6)
    assert known(tracker).forward_m == pytest.approx(1.8)
    assert (known(tracker).captured_s, known(tracker).heading_deg) == (0.6, None)


def _headings(seen_deg: list[float]) -> list[float]:
    """Return the headings of the fix after each of so many sightings."""
    tracker, found = MarkTracker(), []
    for index, heading_deg in enumerate(seen_deg):
        tracker.predict(state(TICK_S * index))
        see(tracker, 2.0, 0.0, captured_s=TICK_S * index, heading_deg=heading_deg)
        found.append(known(tracker).heading_deg or 0.0)
    tracker.predict(state(TICK_S * len(seen_deg), yaw_rad=math.radians(20.0)))
    turned_deg = (known(tracker).heading_deg or 0.0) - found[-1]
    assert math.remainder(turned_deg - 20.0, 360.0) == pytest.approx(0.0, abs=1e-6)
    return found


def test_headings_average_turn_with_the_drone_and_outliers_must_stay() -> None:
    assert _headings([30.0]) == pytest.approx([30.0])
    # 179 and -179 degrees are two degrees apart; their mean is 180, not 0.
    assert abs(_headings([179.0, -179.0])[-1]) == pytest.approx(180.0, abs=0.1)
    headings = _headings([0.0] * 5 + [90.0] * 7)
    assert headings[5:10] == pytest.approx([0.0] * 5, abs=0.1)
    assert headings[10:] == pytest.approx([90.0] * 2, abs=1.0)
