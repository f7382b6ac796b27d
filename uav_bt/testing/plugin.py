"""The pytest plug-in: fixtures and options of the package.

Heavy imports wait until a fixture or an option is used, because pytest loads this module in every
run on the machine.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from uav_bt import testing


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare the option of the test kit."""
    group = parser.getgroup("uav_bt", "tree files (uav_bt.testing)")
    about = "collect all tree files (*.xml with BTCPP_format) as tests that check them"
    group.addoption("--check-trees", action="store_true", help=about)
    parser.addini("uav_bt_check_trees", "as --check-trees", type="bool", default=False)


def pytest_configure(config: pytest.Config) -> None:
    """Check tree files when the option asks for it."""
    if config.getoption("check_trees") or config.getini("uav_bt_check_trees"):
        from uav_bt.testing.check_plugin import CheckPlugin  # noqa: PLC0415  # see above

        config.pluginmanager.register(CheckPlugin(), "uav_bt_check_trees")


@pytest.fixture
def leaf_bench() -> Callable[..., testing.LeafBench]:
    """Return a maker of benches: `leaf_bench(Explore, policy="segmentation")`."""
    return testing.LeafBench


@pytest.fixture
def tree_bench() -> Callable[..., testing.TreeBench]:
    """Return a maker of benches: `tree_bench("mission.xml", mocks={"Land": "RRS"})`."""
    return testing.load_tree


@pytest.fixture
def manual_clock() -> testing.ManualClock:
    """Return a clock that moves only by `advance`."""
    return testing.ManualClock()


@pytest.fixture
def strict_board(manual_clock: testing.ManualClock) -> testing.StrictBlackboard:
    """Return an empty board on the manual clock that refuses wrong access."""
    from uav_bt.board import MISSION_KEYS  # noqa: PLC0415  # see the module's docstring

    return testing.StrictBlackboard(manual_clock, MISSION_KEYS)


@pytest.fixture
def scripted_drone(manual_clock: testing.ManualClock) -> testing.ScriptedDrone:
    """Return a drone without a world, on the manual clock."""
    return testing.ScriptedDrone(clock=manual_clock)
