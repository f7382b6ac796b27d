"""The part of the pytest plug-in that measures the coverage of tree files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import pytest

from uav_bt.errors import FileError, InputError
from uav_bt.testing.branch_coverage import FileCoverage, TreeCoverage, percentage
from uav_bt.testing.tree_files import is_tree_file
from uav_bt.tree import MissionTree, NodeRegistry
from uav_bt.tree.shipped import tree_files

_OUTPUT: Final = "uav_bt_tree_coverage"  # key of a worker process's results


def coverage_plugin(
    targets: Sequence[Path], fail_under: str, *, folder: Path, reports: bool
) -> CoveragePlugin:
    """Return the plug-in for some files and folders.

    Args:
        targets: files, or folders with all tree files in them.
        fail_under: text of the minimum percentage; empty: no minimum.
        folder: the folder in which pytest was started; shown paths are relative to it.
        reports: False in a worker process, which sends its results to the main process.

    Raises:
        UsageError: a file does not exist, or the percentage cannot be read.
    """
    try:
        files = [file for target in targets for file in _files(folder / target)]
        minimum = _percentage(fail_under) if fail_under else 0.0
    except FileError as error:
        raise pytest.UsageError(f"--tree-coverage: {error}") from error
    except ValueError as error:
        raise pytest.UsageError(
            f"--tree-coverage-fail-under: expected 0 to 100, got '{fail_under}'"
        ) from error
    unique = list({_shown(file, folder): None for file in files})
    return CoveragePlugin(TreeCoverage(unique), minimum, reports=reports)


def _files(target: Path) -> list[Path]:
    files = tree_files(target)
    if not target.is_dir():
        return list(files)
    trees = [file for file in files if is_tree_file(file)]
    if not trees:
        raise FileError(target, "no tree file (*.xml with BTCPP_format) in this folder or below")
    return trees


def _percentage(text: str) -> float:
    value = float(text)
    if not 0.0 <= value <= 100.0:
        raise ValueError(text)
    return value


def _shown(file: Path, folder: Path) -> Path:
    file = file.resolve()
    if Path.cwd() == folder and file.is_relative_to(folder):
        return file.relative_to(folder)
    return file


class CoveragePlugin:
    """Watches every tree that is made during the run, and reports at its end.

    Args:
        coverage: the measured files.
        minimum: the share of branches below which the run fails, percent.
        reports: False in a worker process, which sends its results to the main process.
    """

    def __init__(self, coverage: TreeCoverage, minimum: float, *, reports: bool) -> None:
        self._coverage = coverage
        self._minimum = minimum
        self._reports = reports
        self._results: list[FileCoverage] = []
        MissionTree.made_hooks.append(coverage.watch)

    def pytest_unconfigure(self) -> None:
        """Stop watching new trees."""
        MissionTree.made_hooks.remove(self._coverage.watch)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any, error: object) -> None:
        """Merge the results of a worker process; one that crashed has none."""
        del error
        output = getattr(node, "workeroutput", {})
        if _OUTPUT in output:
            self._coverage.merge(output[_OUTPUT])

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Send the results to the main process, or evaluate them there."""
        if not self._reports:
            # pytest-xdist gives a worker's configuration this dictionary.
            session.config.workeroutput[_OUTPUT] = self._coverage.export()  # type: ignore[attr-defined]
            return
        if session.config.getoption("collectonly"):
            self._reports = False  # nothing ran
            return
        try:
            registry = NodeRegistry.installed()
        except InputError:
            # Other tests report a broken package; the nodes of the format are always there.
            registry = NodeRegistry()
        self._results = self._coverage.results(registry)
        if percentage(self._results) < self._minimum and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Print the covered and the missing branches."""
        if not self._reports:
            return
        write = terminalreporter.write_line
        terminalreporter.write_sep("-", "tree coverage")
        for result in self._results:
            if result.refused:
                write(f"{result.path}: not measured: {result.refused}")
                continue
            write(
                f"{result.path}: {result.ticked} of {result.nodes} nodes ticked, "
                f"{result.taken} of {result.branches} branches taken, {result.percent} %"
            )
            for line in result.missing:
                write(f"  {line}")
        total = percentage(self._results)
        write(f"tree coverage: {total} %")
        if total < self._minimum:
            write(f"FAIL: expected a tree coverage of at least {self._minimum:g} %, got {total} %")
