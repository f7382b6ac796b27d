"""Fixtures of the twin's tests."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from sim_bridge.twin import TwinConfig
from sim_bridge.twin.drone import TwinDrone
from tests.sim_bridge.twin.lab_world import fly
from uav_bt.types import TakeOff

SMALL = (160, 90)


@pytest.fixture
def make_twin() -> Iterator[Callable[..., TwinDrone]]:
    """Yield a maker of connected twins with small images; all are disconnected at the end."""
    with ExitStack() as ends:

        def make(*, airborne: bool = False, **options: object) -> TwinDrone:
            drone = TwinConfig(**{"profile": "ideal", "image_size_px": SMALL} | options).create()
            ends.callback(drone.disconnect)
            drone.connect()
            if airborne:
                fly(drone, TakeOff(), 4.5)
            return drone

        yield make
