"""What the tests of the firmware share."""

from __future__ import annotations

import pytest

from tests.sim_bridge.loopback.loopback_world import Bench


@pytest.fixture
def bench() -> Bench:
    """Return a drone that stands on the ground."""
    return Bench()
