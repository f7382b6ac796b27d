"""Fixtures of the firmware's tests."""

from __future__ import annotations

import pytest

from tests.sim_bridge.loopback.loopback_world import Bench


@pytest.fixture
def bench() -> Bench:
    """Return a drone on the ground."""
    return Bench()
