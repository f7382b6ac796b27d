"""Starter missions: good from the start, and those that ship and are flown."""

from __future__ import annotations

from pathlib import Path

import pytest

from uav_bt.errors import FileError, UnknownNameError
from uav_bt.tree import load_tree, parse_tree
from uav_bt.tree.loading.loader import check_file
from uav_bt.tree.render import render
from uav_bt.tree.shipped import resolve_tree
from uav_bt.tree.starter import STARTERS, starter_mission, write_starter


@pytest.mark.parametrize("start", STARTERS)
def test_a_starter_is_good_and_is_the_shipped_mission_with_a_comment(
    tmp_path: Path, start: str
) -> None:
    path = tmp_path / "mine.xml"
    write_starter(path, start)
    assert check_file(path) == ()
    text = path.read_text(encoding="utf-8")
    assert text.count("How to read it") == 1
    assert 'attribute="{@name}"' in text
    shipped = load_tree(resolve_tree(STARTERS[start]))
    assert render(parse_tree(text), "svg") == render(shipped, "svg")


def test_a_file_that_exists_is_never_touched(tmp_path: Path) -> None:
    path = tmp_path / "mine.xml"
    path.write_text("mine", encoding="utf-8")
    with pytest.raises(FileError, match="not overwritten"):
        write_starter(path)
    assert path.read_text(encoding="utf-8") == "mine"


def test_what_cannot_be_written_is_told(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot be written: No such file"):
        write_starter(tmp_path / "absent" / "mine.xml")
    with pytest.raises(FileError, match=r"ends in \.xml"):
        write_starter(tmp_path / "mine.txt")
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_starter_gets_a_suggestion() -> None:
    with pytest.raises(UnknownNameError, match="'hove'; did you mean 'hover'"):
        starter_mission("hove")
