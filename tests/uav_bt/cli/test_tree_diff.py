"""`uav-bt tree diff`: exit codes as diff has them, colour on terminals only."""

from __future__ import annotations

from pathlib import Path

from click.testing import CliRunner

from tests.uav_bt.cli.cli_world import HOP, assert_refused, run, tree_file
from uav_bt.cli.root import uav_bt


def test_the_same_and_different_files(tmp_path: Path) -> None:
    one = tree_file(tmp_path, HOP, "one.xml")
    other = tree_file(tmp_path, HOP.replace("1.0", "1.5").replace("<Land/>", ""), "other.xml")
    same = run("tree", "diff", one, one)
    assert (same.exit_code, same.output) == (0, "")
    result = run("tree", "diff", one, other)
    assert (result.exit_code, result.stderr) == (1, "")
    assert result.stdout == (
        f"--- {one}\n+++ {other}\n"
        'changed  Main/Sequence/TakeOff (line 3 -> 3): height_m="1.0" is now "1.5"\n'
        "removed  Main/Sequence/Land (line 3)\n"
    )


def test_a_terminal_shows_colours(tmp_path: Path) -> None:
    one = tree_file(tmp_path, HOP, "one.xml")
    other = tree_file(tmp_path, HOP.replace("<Land/>", ""), "other.xml")
    shown = CliRunner().invoke(uav_bt, ["tree", "diff", str(one), str(other)], color=True)
    assert "\x1b[31mremoved" in shown.stdout


def test_missions_that_ship_are_known_by_name() -> None:
    result = run("tree", "diff", "explore_and_land_depth", "explore_and_land_segmentation")
    assert result.exit_code == 1
    assert 'policy="corridor" is now "segmentation"' in result.stdout


def test_what_cannot_be_read_is_refused(tmp_path: Path) -> None:
    good = tree_file(tmp_path, HOP, "good.xml")
    broken = tree_file(tmp_path, "<Sequence>", "broken.xml")
    assert_refused(run("tree", "diff", good, broken), "broken.xml:4:", "not well-formed")
    assert_refused(run("tree", "diff", tmp_path / "absent.xml", good), "absent.xml")
    assert_refused(run("tree", "diff", good), "AFTER")
