"""Fixtures of the twin's tests."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from sim_bridge.twin import TwinConfig
from sim_bridge.twin.drone import TwinDrone
from tests.sim_bridge.twin.lab_world import MakeTwin, fly
from tests.sim_bridge.twin.room_world import write_lab
from uav_bt.types import TakeOff

SMALL = (160, 90)


@pytest.fixture
def make_twin() -> Iterator[MakeTwin]:
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


@pytest.fixture
def hall(tmp_path: Path) -> Path:
    """Return the folder of a lab of every shape."""
    return write_lab(tmp_path / "hall")
