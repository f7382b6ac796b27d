"""The pytest plug-in: fixtures and options of the package.

Heavy imports wait until a fixture or an option is used, because pytest loads this module in every
run on the machine.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

import pytest

from uav_bt import testing

_LOOKUP_OPTIONS: Final = {
    "folder": (
        "DIR",
        "with --check-trees: a folder whose trees SubTrees may use, too; may be repeated",
    ),
    "include_root": (
        "DIR",
        "with --check-trees: a folder that files may be included from, besides the file's own",
    ),
    "palette": (
        "FILE",
        "with --check-trees: a file that describes nodes that are not installed; may be repeated",
    ),
}


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare the options of the test kit."""
    group = parser.getgroup("uav_bt", "tree files (uav_bt.testing)")
    group.addoption(
        "--check-trees",
        action="store_true",
        help="collect all tree files (*.xml with BTCPP_format) as tests that check them",
    )
    for option, (metavar, meaning) in _LOOKUP_OPTIONS.items():
        flag = f"--check-trees-{option.replace('_', '-')}"
        group.addoption(flag, action="append", default=[], metavar=metavar, help=meaning)
        ini = f"uav_bt_check_trees_{option}"
        parser.addini(ini, f"as {flag}", type="paths", default=[])
    group.addoption(
        "--tree-coverage",
        action="append",
        default=[],
        metavar="FILE",
        help="report which branches of a tree file, or of all in a folder, the tests went through; "
        "may be given several times",
    )
    group.addoption(
        "--tree-coverage-fail-under",
        default="",
        metavar="PERCENT",
        help="fail the run when the branch coverage is below this percentage",
    )
    parser.addini("uav_bt_check_trees", "as --check-trees", type="bool", default=False)
    parser.addini("uav_bt_tree_coverage", "as --tree-coverage", type="paths", default=[])
    parser.addini("uav_bt_tree_coverage_fail_under", "as --tree-coverage-fail-under", default="")


def pytest_configure(config: pytest.Config) -> None:
    """Check tree files and measure their coverage when options ask for it."""
    if config.getoption("check_trees") or config.getini("uav_bt_check_trees"):
        from uav_bt.testing.check_plugin import CheckPlugin  # noqa: PLC0415  # see above

        given = {
            option: [Path(each) for each in config.getoption(f"check_trees_{option}")]
            or config.getini(f"uav_bt_check_trees_{option}")
            for option in _LOOKUP_OPTIONS
        }
        config.pluginmanager.register(CheckPlugin(given), "uav_bt_check_trees")
    targets = [Path(target) for target in config.getoption("tree_coverage")]
    targets = targets or list(config.getini("uav_bt_tree_coverage"))
    if not targets:
        return
    from uav_bt.testing.coverage_plugin import coverage_plugin  # noqa: PLC0415  # see above

    minimum = config.getoption("tree_coverage_fail_under")
    plugin = coverage_plugin(
        targets,
        minimum or config.getini("uav_bt_tree_coverage_fail_under"),
        folder=config.invocation_params.dir,
        reports=not hasattr(config, "workerinput"),
    )
    config.pluginmanager.register(plugin, "uav_bt_tree_coverage")


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
