"""Files are complete or absent; the system's errors name the file."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.worlds.tables import cases
from uav_bt.errors import FileError, SceneError
from uav_bt.files import did_you_mean_file, reading, whole_file, write_whole

CASES = cases("yaml_files")


@pytest.mark.parametrize("content", ["größer\n", b"\x00\xff"])
def test_a_whole_file_replaces_the_old_one(tmp_path: Path, content: bytes | str) -> None:
    path = tmp_path / "a.json"
    path.write_text("old")
    write_whole(path, content)
    assert path.read_bytes() == (content.encode() if isinstance(content, str) else content)
    assert list(tmp_path.iterdir()) == [path]


def test_a_break_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("old")

    def interrupted() -> None:
        with whole_file(path) as partial:
            partial.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_what_cannot_be_written_raises_and_nothing_is_left(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    with pytest.raises(FileError, match="a: cannot be written: Is a directory"):
        write_whole(tmp_path / "a", "new")
    with pytest.raises(FileError, match="cannot be written: No such file") as caught:
        write_whole(tmp_path / "absent" / "a", "new")
    assert caught.value.path == tmp_path / "absent" / "a"
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


@pytest.mark.parametrize(("missing", "hint"), CASES["hints"])
def test_a_missing_file_is_compared_with_the_files_beside_it(
    missing: str, hint: str, tmp_path: Path
) -> None:
    (tmp_path / "peek.xml").touch()
    (tmp_path / "runs").mkdir()
    assert did_you_mean_file(tmp_path / missing) == hint


def test_reading_raises_the_error_that_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    with pytest.raises(SceneError, match="no such file"), reading(path, SceneError):
        path.read_text()
    path.write_bytes(b"\xff")
    with pytest.raises(FileError, match="cannot be read as UTF-8 text"), reading(path):
        path.read_text(encoding="utf-8")
