"""The pytest plug-in: fixtures and options of the package.

Heavy imports wait until a fixture or an option is used, because pytest loads this module in every
run on the machine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import pytest

from uav_bt import testing
from uav_bt.testing.tree_files import is_tree_file

if TYPE_CHECKING:
    from uav_bt.tree.loading.together import FilesTogether

_COLLECTED: Final = pytest.StashKey[list[Path]]()
_TOGETHER: Final[pytest.StashKey[FilesTogether]] = pytest.StashKey()

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
    """Measure the coverage of tree files when an option asks for it."""
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


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Collect tree files as tests when an option asks for it."""
    if file_path.suffix != ".xml":
        return None
    config = parent.config
    if not (config.getoption("check_trees") or config.getini("uav_bt_check_trees")):
        return None
    if not is_tree_file(file_path):
        return None
    config.stash.setdefault(_COLLECTED, []).append(file_path)
    return TreeFile.from_parent(parent, path=file_path)


def pytest_collection_finish(session: pytest.Session) -> None:
    """Let the collected tree files use each other's trees."""
    config = session.config
    files = config.stash.get(_COLLECTED, [])
    if not files:
        return
    from uav_bt.errors import InputError  # noqa: PLC0415  # see above
    from uav_bt.tree import NodeRegistry  # noqa: PLC0415  # see above
    from uav_bt.tree.loading.folders import TreeFolders  # noqa: PLC0415  # see above
    from uav_bt.tree.loading.palette import read_palette, with_palette  # noqa: PLC0415
    from uav_bt.tree.loading.together import FilesTogether  # noqa: PLC0415  # see above

    given = {
        option: [Path(each) for each in config.getoption(f"check_trees_{option}")]
        or config.getini(f"uav_bt_check_trees_{option}")
        for option in _LOOKUP_OPTIONS
    }
    root = given["include_root"][-1] if given["include_root"] else None
    try:
        registry = NodeRegistry.installed()
        for palette in given["palette"]:
            registry = with_palette(registry, read_palette(palette))
        lookup = TreeFolders(trees=given["folder"], include_root=root).lookup()
    except InputError as error:
        raise pytest.UsageError(f"--check-trees: {error}") from error
    lookup = replace(lookup, library=lookup.library.joined_by(files))
    config.stash[_TOGETHER] = FilesTogether(map(_short, files), registry, lookup=lookup)


def _short(path: Path) -> Path:
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


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


class _RefusedError(Exception):
    """A tree file has findings."""


class TreeFile(pytest.File):
    """A tree file among the test files."""

    def collect(self) -> Iterator[pytest.Item]:
        """Return its only test."""
        yield TreeCheck.from_parent(self, name="check")


class TreeCheck(pytest.Item):
    """The strict check of a tree file."""

    def runtest(self) -> None:
        """Check the file.

        Raises:
            _RefusedError: there are errors.
        """
        from uav_bt.tree.loading.findings import errors_of  # noqa: PLC0415  # see above

        findings = self.config.stash[_TOGETHER].findings(_short(self.path))
        if errors_of(findings):
            raise _RefusedError("\n".join(map(str, findings)))

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Show the findings alone, without a traceback."""
        if isinstance(excinfo.value, _RefusedError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int, str]:
        """Return how reports name the test."""
        return self.path, 0, f"tree file {self.path.name}"
