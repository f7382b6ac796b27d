"""Which tree files a person means."""

from __future__ import annotations

from pathlib import Path

import pytest

from uav_bt.errors import FileError
from uav_bt.tree.shipped import resolve_tree, shipped_trees, tree_files


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


def test_a_hidden_folder_that_is_asked_for_is_looked_into(tmp_path: Path) -> None:
    folder = tmp_path / ".missions"
    folder.mkdir()
    (folder / "a.xml").write_text("", encoding="utf-8")
    assert tree_files(folder) == (folder / "a.xml",)


def test_a_folder_without_tree_files_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="no tree file"):
        tree_files(tmp_path)
