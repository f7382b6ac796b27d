"""Conversion of metres from home to degrees."""

from __future__ import annotations

import pytest

from sim_bridge.loopback.world import HOME, location, offset_m


def test_places_and_offsets_are_inverse() -> None:
    there = location(120.0, -340.0)
    assert offset_m(there.latitude_deg, there.longitude_deg) == pytest.approx((120.0, -340.0))
    assert location(0.0, 0.0) == HOME
