"""The landing mark of lab files, and the default that comes from the paper's lab."""

from __future__ import annotations

from pathlib import Path

import pytest

from uav_bt.errors import FileError
from uav_bt.lab.lab_file import read_lab
from uav_bt.lab.shipped import default_mark, load_lab
from uav_bt.types import LandingMark

CLASSES = """
version: 1
classes:
  wall: {role: outside, colour: "#000000"}
  floor: {role: ground, colour: "#111111"}
  tag: {role: mark, colour: "#222222"}
"""


def lab(folder: Path, mark: str) -> LandingMark | None:
    (folder / "lab.yaml").write_text(f"{CLASSES}{mark}\n")
    return read_lab(folder).mark


def test_the_papers_lab_states_the_usual_mark() -> None:
    assert default_mark() == load_lab("paper").mark
    assert default_mark() == LandingMark(length_m=0.5, width_m=0.5, height_m=0.4)


def test_a_lab_states_kind_size_and_options(tmp_path: Path) -> None:
    text = "mark: {kind: aruco, size_m: [0.4, 0.6], height_m: 0, options: {id: 1, size_m: 0.3}}"

    assert lab(tmp_path, text) == LandingMark(
        kind="aruco", length_m=0.4, width_m=0.6, height_m=0.0, options={"id": 1, "size_m": 0.3}
    )


def test_a_lab_may_have_no_mark(tmp_path: Path) -> None:
    assert lab(tmp_path, "") is None


@pytest.mark.parametrize(
    ("mark", "message"),
    [
        ("{size_m: [0.5, 0.5]}", "7: mark: lacks the key 'height_m'"),
        ("{height_m: 0.1}", "7: mark: lacks the key 'size_m'"),
        ("{size_m: [0.5, 0.5], height_m: -0.1}", "7: mark.height_m: expected a number greater"),
        ("{size_m: [0.5, 0.5], height_m: 0, kind: tag}", "7: mark: unknown landing mark 'tag'"),
    ],
)
def test_a_wrong_mark_is_refused_with_its_line(tmp_path: Path, mark: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        lab(tmp_path, f"mark: {mark}")
