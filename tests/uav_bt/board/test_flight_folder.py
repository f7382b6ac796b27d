"""The output folder of a flight."""

from __future__ import annotations

from pathlib import Path

import pytest

from uav_bt.board.context import FlightFolder
from uav_bt.errors import FileError


def test_it_is_made_with_the_first_file(tmp_path: Path) -> None:
    folder = FlightFolder(tmp_path / "new" / "flight")
    assert not folder.folder.exists()
    folder.write("notes.txt", "read")
    folder.write("image.jpg", b"\x00\x01")
    assert (folder.folder / "notes.txt").read_text(encoding="utf-8") == "read"
    assert (folder.folder / "image.jpg").read_bytes() == b"\x00\x01"
    with pytest.raises(FileError, match=r"has files, .* name another one, or empty this one"):
        FlightFolder(folder.folder)
    with pytest.raises(FileError, match="is a file and no folder"):
        FlightFolder(folder.folder / "notes.txt")


@pytest.mark.parametrize(
    "name", ["", ".", "..", "../a", "a/b", "a\\b", "/a", ".hidden", "ä", "a\n"]
)
def test_a_name_that_is_no_plain_name_is_refused(name: str, tmp_path: Path) -> None:
    folder = FlightFolder(tmp_path / "out")
    with pytest.raises(FileError, match="expected letters, digits"):
        folder.write(name, "x")
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    folder = FlightFolder(tmp_path, reserved=["report.json"])
    folder.write("a.txt", "first")
    (tmp_path / "link.txt").symlink_to("nowhere.txt")
    for name, said in (("a.txt", "exists"), ("link.txt", "exists"), ("report.json", "another")):
        with pytest.raises(FileError, match=said):
            folder.write(name, "second")
    assert (tmp_path / "a.txt").read_text(encoding="utf-8") == "first"
    assert not (tmp_path / "report.json").exists()
