"""How long a condition has held."""

from __future__ import annotations

import pytest

from uav_bt.mission.lasting import Lasting


def test_time_is_counted_from_the_first_tick() -> None:
    lasting = Lasting()
    assert [lasting.update(now_s, holds=True) for now_s in (5.0, 5.5, 6.5)] == [0.0, 0.5, 1.5]


def test_a_short_gap_does_not_end_it_and_a_long_one_does() -> None:
    """Frames with a latency near the limit are alternately fresh and stale."""
    lasting = Lasting()
    lasting.update(1.0, holds=True)
    assert lasting.update(1.4, holds=False) == 0.0
    assert lasting.update(1.8, holds=True) == pytest.approx(0.8)
    assert lasting.update(3.0, holds=True) == 0.0


def test_without_a_tolerated_gap_one_tick_ends_it() -> None:
    lasting = Lasting(gap_s=0.0)
    assert [lasting.update(now_s, holds=True) for now_s in (1.0, 2.5)] == [0.0, 1.5]
    lasting.update(2.6, holds=False)
    assert lasting.update(2.7, holds=True) == 0.0


def test_a_reset_begins_anew() -> None:
    lasting = Lasting()
    lasting.update(1.0, holds=True)
    lasting.reset()
    assert lasting.update(1.5, holds=True) == 0.0
