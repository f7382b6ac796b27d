"""A leaf's own time."""

import pytest

from behaviours.fly.moving_leaf import LeafClock
from uav_bt.clock import ManualClock


def test_a_pause_between_two_ticks_of_one_activation_does_not_count() -> None:
    """Ticks of up to a second do. Between two activations there is no pause."""
    clock = ManualClock()
    own = LeafClock(clock)
    begin_s = own.now()
    for passed_s, paused_s in ((0.0, 0.0), (1.0, 0.0), (30.0, 30.0), (0.5, 0.0)):
        clock.advance(passed_s)
        assert own.tick() == pytest.approx(paused_s)
    assert own.resumed_s == clock.now() - 0.5
    assert own.now() - begin_s == pytest.approx(1.5)
    own.stop()
    clock.advance(30.0)
    assert own.tick() == 0.0
    assert own.now() - begin_s == pytest.approx(31.5)
