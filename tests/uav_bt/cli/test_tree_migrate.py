"""`uav-bt tree migrate`: prints or writes a new file, and never touches one that exists."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.uav_bt.cli.cli_world import assert_refused, run

OLD = (
    '<root>\n<BehaviorTree ID="M">\n<SequenceStar><AlwaysSuccess/></SequenceStar>\n'
    "</BehaviorTree>\n</root>\n"
)


@pytest.fixture
def old(tmp_path: Path) -> Path:
    """Return a file of version 3."""
    path = tmp_path / "old.xml"
    path.write_text(OLD)
    return path


def test_it_is_printed(old: Path) -> None:
    result = run("tree", "migrate", old)
    assert (result.exit_code, result.stderr) == (0, "")
    assert "<SequenceWithMemory>" in result.stdout
    assert old.read_text() == OLD


def test_it_is_written_once_and_is_good(old: Path, tmp_path: Path) -> None:
    new = tmp_path / "new.xml"
    assert run("tree", "migrate", old, "--out", new).exit_code == 0
    assert run("check", new).stdout == f"{new}: good\n"
    written = new.read_text()
    assert_refused(run("tree", "migrate", old, "--out", new), "not overwritten")
    assert new.read_text() == written
    assert_refused(run("tree", "migrate", old, "--out", old), "old.xml")
    assert old.read_text() == OLD


def test_what_cannot_be_carried_over_is_listed(old: Path) -> None:
    old.write_text(OLD.replace("<AlwaysSuccess/>", '<SubTree ID="A" __shared_blackboard="1"/>'))
    result = run("tree", "migrate", old)
    assert result.exit_code == 1
    assert "_autoremap" in result.stdout
    assert result.stderr.startswith(f"{old}:3:31: warning: SubTree: _autoremap shares")


def test_other_files_are_refused(old: Path, tmp_path: Path) -> None:
    old.write_text(OLD.replace("<root", '<root BTCPP_format="4"'))
    assert_refused(run("tree", "migrate", old), f"{old}:1:7", "without BTCPP_format")
    assert_refused(run("tree", "migrate", tmp_path / "absent.xml"), "no such file")
