"""Findings of a mission file, with positions: a missing file, and errors that are no findings."""

from __future__ import annotations

from pathlib import Path

from uav_bt.errors import FileError, InputError
from uav_bt.tree.loading.findings import WHOLE_FILE, Finding, Position
from uav_bt.tree.loading.loader import check_file, findings_of


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
