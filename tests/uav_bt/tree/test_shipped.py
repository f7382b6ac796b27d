"""From names and paths to tree files."""

from __future__ import annotations

from pathlib import Path

import pytest

from uav_bt.errors import FileError
from uav_bt.tree import load_tree, parse_tree
from uav_bt.tree.describe import sketch
from uav_bt.tree.loading.loader import check_file
from uav_bt.tree.loading.lookup import shipped_trees
from uav_bt.tree.shipped import STARTERS, resolve_tree, tree_files, write_starter


def test_a_file_stands_for_itself_and_a_name_for_a_shipped_mission(tmp_path: Path) -> None:
    path = tmp_path / "mine.txt"
    path.write_text("<root/>", encoding="utf-8")
    assert tree_files(path) == (path,)
    assert tree_files("land_only") == (resolve_tree("land_only"),)
    assert resolve_tree("land_only").parent == shipped_trees()


def test_a_folder_stands_for_its_xml_files_in_order_without_hidden_ones(tmp_path: Path) -> None:
    for name in ("b.xml", "a.xml", "deep/er/c.xml", ".git/d.xml", ".e.xml", "f.yaml"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("", encoding="utf-8")
    (tmp_path / "folder.xml").mkdir()
    found = [path.relative_to(tmp_path).as_posix() for path in tree_files(tmp_path)]
    assert found == ["a.xml", "b.xml", "deep/er/c.xml"]


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
    assert sketch(parse_tree(text).root) == sketch(shipped.root)


def test_refusals_leave_the_files_as_they_are(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="no tree file"):
        tree_files(tmp_path)
    path = tmp_path / "mine.xml"
    path.write_text("mine", encoding="utf-8")
    for wrong, message in (
        (path, "not overwritten"),
        (tmp_path / "absent" / "mine.xml", "cannot be written: No such file"),
        (tmp_path / "mine.txt", r"ends in \.xml"),
    ):
        with pytest.raises(FileError, match=message):
            write_starter(wrong)
    assert [one.read_text(encoding="utf-8") for one in tmp_path.iterdir()] == ["mine"]
