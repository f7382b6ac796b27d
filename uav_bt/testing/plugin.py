"""The pytest plug-in: fixtures that come with the package.

Heavy imports wait until a fixture is used: pytest loads this module in every run on this machine.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from uav_bt.clock import ManualClock
    from uav_bt.testing.bench import LeafBench
    from uav_bt.testing.drone import ScriptedDrone

__all__ = ["leaf_bench", "manual_clock", "scripted_drone"]


@pytest.fixture
def leaf_bench() -> Callable[..., LeafBench]:
    """Return a maker of benches: `leaf_bench(Explore, policy="segmentation")`."""
    from uav_bt.testing.bench import LeafBench  # noqa: PLC0415  # see the module's docstring

    return LeafBench


@pytest.fixture
def manual_clock() -> ManualClock:
    """Return a clock that moves only when told to."""
    from uav_bt.clock import ManualClock  # noqa: PLC0415  # see the module's docstring

    return ManualClock()


@pytest.fixture
def scripted_drone(manual_clock: ManualClock) -> ScriptedDrone:
    """Return a drone without a world, on the manual clock."""
    from uav_bt.testing.drone import ScriptedDrone  # noqa: PLC0415  # see the module's docstring

    return ScriptedDrone(clock=manual_clock)
