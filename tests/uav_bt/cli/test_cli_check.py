"""`uav-bt check`: all findings of all files, and whether the policies exist."""

from __future__ import annotations

from pathlib import Path

import pytest
from cli_world import HOP, assert_refused, run, tree_file

SHIPPED = Path(__file__).parents[3] / "trees"


@pytest.mark.parametrize("path", sorted(SHIPPED.glob("*.xml")), ids=lambda path: path.stem)
def test_shipped_missions_are_good_by_file_and_by_name(path: Path) -> None:
    by_file, by_name = run("check", path), run("check", path.stem)
    assert (by_file.exit_code, by_name.exit_code) == (0, 0), by_file.output + by_name.output
    assert by_file.stdout == f"{path}: good\n"


def test_all_findings_of_all_files_are_told_with_their_lines(tmp_path: Path) -> None:
    good = tree_file(tmp_path, HOP, "good.xml")
    bad = tree_file(tmp_path, '<Sequence>\n<TakOff/>\n<Land hight="1"/>\n</Sequence>', "bad.xml")
    worse = tree_file(tmp_path, "<Sequence>", "worse.xml")
    result = run("check", bad, good, worse)
    assert result.exit_code == 2
    assert result.stdout == f"{good}: good\n"
    lines = result.stderr.splitlines()
    assert len(lines) == 3
    assert lines[0].startswith(f"{bad}:4:")
    assert "did you mean 'TakeOff'" in lines[0]
    assert lines[1].startswith(f"{bad}:5:")
    assert "hight" in lines[1]
    assert lines[2].startswith(f"{worse}:")


def test_a_policy_that_nobody_registered_is_a_finding_with_its_line(tmp_path: Path) -> None:
    body = (
        "<Sequence>\n"
        '<Explore policy="segmentation"/>\n'
        '<Explore policy="segmentatio"/>\n'
        '<Avoid policy="depht"/>\n'
        "</Sequence>"
    )
    path = tree_file(tmp_path, body)
    result = run("check", path)
    assert_refused(result)
    first, second = result.stderr.splitlines()
    assert first.startswith(f"{path}:5:")
    assert "'segmentatio'; did you mean 'segmentation'" in first
    assert second.startswith(f"{path}:6:")
    assert "unknown policy 'depht'" in second


def test_a_policy_that_a_variable_names_is_left_to_the_flight(tmp_path: Path) -> None:
    assert run("check", tree_file(tmp_path, '<Explore policy="{way}"/>')).exit_code == 0


def test_an_absent_file_is_told_and_the_others_are_checked(tmp_path: Path) -> None:
    good = tree_file(tmp_path, HOP)
    result = run("check", tmp_path / "absent.xml", good)
    assert result.exit_code == 2
    assert "absent.xml: no such tree file" in result.stderr
    assert result.stdout == f"{good}: good\n"


def test_a_folder_is_no_tree_file(tmp_path: Path) -> None:
    assert_refused(run("check", tmp_path), str(tmp_path))


def test_nothing_to_check_is_wrong_usage() -> None:
    assert_refused(run("check"), "TREE")
