"""Clocks: a manual one, a real-time one, and one that is constant within a tick."""

from __future__ import annotations

import time

import pytest

from uav_bt.clock import ManualClock, TickClock, WallClock


def test_a_wall_clock_sleeps_what_is_left_and_not_at_all_when_it_is_late(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    slept: list[float] = []
    monkeypatch.setattr(time, "monotonic", lambda: 1000.0)
    monkeypatch.setattr(time, "sleep", slept.append)
    clock = WallClock()
    clock.sleep_until(0.3)
    clock.sleep_until(-2.0)
    assert slept == [0.3, 0.0]
    monkeypatch.setattr(time, "monotonic", lambda: 1002.5)
    assert clock.now() == 2.5


def test_a_tick_clock_stands_still_until_the_next_tick() -> None:
    real = ManualClock(1.0)
    clock = TickClock(real)
    real.advance(0.5)
    assert clock.now() == 1.5  # no tick has begun
    assert clock.begin_tick() == 1.5
    real.advance(0.1)
    assert clock.now() == 1.5
    clock.sleep_until(2.0)
    assert (real.now(), clock.now()) == (2.0, 1.5)
    assert clock.begin_tick() == clock.now() == 2.0
