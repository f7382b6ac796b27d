"""The guide to the test kit: its files are written and its commands run, in the order of the page.

A block's first line names its file; a console block has a command and what must be in its output,
line by line.
"""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from uav_bt.testing import coverage_plugin
from uav_bt.tree import NodeRegistry

pytest_plugins = ["pytester"]

GUIDE = Path(__file__).parents[3] / "docs" / "testing.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NAME = re.compile(r"(?:# |<!-- )([\w.]+)")
# Plug-ins that have no part in this and take seconds to load.
WITHOUT = ("-p", "no:cacheprovider", "-p", "no:hypothesispytest", "-p", "no:benchmark")


@pytest.fixture(scope="module", autouse=True)
def _loaded() -> None:
    """Load what the inner runs load, which otherwise each would do anew."""
    assert coverage_plugin
    NodeRegistry.installed()


def run(pytester: pytest.Pytester, *arguments: str) -> pytest.RunResult:
    return pytester.runpytest_inprocess(*WITHOUT, "-p", "no:xdist", *arguments)


def test_the_guide_is_true(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    """All its tests pass, and its commands say what it says they say."""
    monkeypatch.syspath_prepend(pytester.path)
    written: list[str] = []
    commands = 0
    for kind, text in BLOCK.findall(GUIDE.read_text(encoding="utf-8")):
        if kind == "console":
            command, *expected = text.splitlines()
            assert command.startswith("$ pytest ")
            result = run(pytester, *shlex.split(command.removeprefix("$ pytest ")))
            result.stdout.fnmatch_lines(expected)
            commands += 1
        else:
            named = NAME.match(text)
            assert named is not None, text
            pytester.path.joinpath(named[1]).write_text(text, encoding="utf-8")
            written.append(named[1])
    assert commands == 3
    assert sum(name.startswith("test_") for name in written) == 5
    result = run(pytester, "-q")
    assert result.ret == pytest.ExitCode.OK
    result.assert_outcomes(passed=14)
