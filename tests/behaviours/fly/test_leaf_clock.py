"""A leaf's own time."""

from __future__ import annotations

import pytest

from behaviours.fly.leaf_clock import LeafClock
from uav_bt.clock import ManualClock


def test_a_pause_between_two_ticks_does_not_count() -> None:
    """Ticks of up to a second do."""
    clock = ManualClock()
    own = LeafClock(clock)
    begin_s = own.now()
    assert own.tick() == 0.0
    clock.advance(1.0)
    assert own.tick() == 0.0
    clock.advance(30.0)
    assert own.tick() == pytest.approx(30.0)
    assert own.resumed_s == clock.now()
    clock.advance(0.5)
    own.tick()

    assert own.now() - begin_s == pytest.approx(1.5)


def test_between_two_activations_there_is_no_pause() -> None:
    clock = ManualClock()
    own = LeafClock(clock)
    own.tick()
    own.stop()
    clock.advance(30.0)
    begin_s = own.now()

    assert own.tick() == 0.0
    assert own.now() == begin_s
