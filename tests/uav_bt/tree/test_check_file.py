"""Findings of a mission file, with positions, for all kinds of mistakes."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.worlds.cases import cases
from uav_bt.errors import FileError, InputError
from uav_bt.tree.loading.findings import WHOLE_FILE, Finding, Position
from uav_bt.tree.loading.loader import check_file, findings_of

CASES = cases("loading")


def tree_file(folder: Path, body: str) -> Path:
    path = folder / "m.xml"
    path.write_text(
        f'<root BTCPP_format="4">\n<BehaviorTree ID="M">\n{body}\n</BehaviorTree></root>',
        encoding="utf-8",
    )
    return path


def test_a_file_that_is_not_there_is_a_finding_about_the_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "absent.xml"
    assert check_file(path) == (Finding(str(path), WHOLE_FILE, "no such file"),)
    assert str(check_file(path)[0]) == f"{path}: no such file"


def test_other_errors_become_findings_too() -> None:
    path = Path("m.xml")
    assert findings_of(FileError("x.yaml", "broken", 7), path) == (
        Finding("x.yaml", Position(7, 1), "broken"),
    )
    assert findings_of(InputError("two packages"), path) == (
        Finding("m.xml", WHOLE_FILE, "two packages"),
    )


@pytest.mark.parametrize(("body", "attribute", "reason"), CASES["failing_scripts"])
def test_a_script_that_fails_in_every_run_is_refused(
    tmp_path: Path, body: str, attribute: str, reason: str
) -> None:
    (finding,) = check_file(tree_file(tmp_path, body))
    assert reason in finding.message
    assert finding.message.startswith(f"attribute '{attribute}': the script always fails: ")


def test_a_script_that_may_work_is_good(tmp_path: Path) -> None:
    for code in ("x := 0; y := x ? 1 / 0 : 1", "x := 1; 1 > x &lt; 1 / 0"):
        assert check_file(tree_file(tmp_path, f'<Script code="{code}" _onSuccess="2"/>')) == ()
