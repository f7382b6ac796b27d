"""Lab files and labs by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.worlds.tables import cases
from uav_bt.errors import FileError, InputError, UnknownNameError
from uav_bt.lab.lab_file import read_lab
from uav_bt.lab.shipped import default_mark, load_lab, shipped_labs
from uav_bt.types import LandingMark

CASES = cases("labs")

GOOD = """\
version: 1
classes:
  wall: {role: outside, colour: "#000000"}
  floor: {role: ground, colour: "#0a0b0c"}
  drum: {role: obstacle, colour: "#ff0000", top: lid}
  lid: {role: obstacle, colour: "#800000"}
"""


def lab_folder(folder: Path, text: str = GOOD) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "lab.yaml").write_text(text)
    return folder


def test_a_lab_file_gives_names_roles_colours_and_tops(tmp_path: Path) -> None:
    lab = read_lab(lab_folder(tmp_path / "hall"))

    assert (lab.name, lab.folder) == ("hall", tmp_path / "hall")
    assert lab.classes.names == ("wall", "floor", "drum", "lid")
    assert lab.classes.colours[1].tolist() == [10, 11, 12]
    assert lab.classes.standing == (2,)
    assert not lab.classes.legs_m.any()


@pytest.mark.parametrize(
    ("kinds", "apart_m"),
    [
        (["class: drum, shape: table", "class: drum, shape: rack"], 1.5),
        (["class: drum, shape: table", "class: drum, shape: box"], 0.0),
        (["class: drum, shape: table, moves: true"], 0.0),
        (["class: lid, shape: table"], 0.0),
    ],
)
def test_tables_and_racks_of_the_room_stand_on_legs(
    tmp_path: Path, kinds: list[str], apart_m: float
) -> None:
    look = "size_m: [0.9, 1.2, 0.8], surface: {colour: '#404040'}"
    objects = "".join(f"    kind_{row}: {{{kind}, {look}}}\n" for row, kind in enumerate(kinds))
    lab = read_lab(lab_folder(tmp_path, f"{GOOD}room:\n  objects:\n{objects}"))
    assert lab.classes.legs_m.tolist() == [0.0, 0.0, pytest.approx(apart_m), 0.0]


@pytest.mark.parametrize(
    ("text", "edge_m"),
    [
        ("room: {walls: {beside_m: 0}}", 0.4),
        ("room: {walls: {beside_m: 0.5}}", None),
        ("room: {walls: {beside_m: 0}}\nmargins: {edge_m: 0.35}", 0.35),
    ],
)
def test_walls_at_the_edge_of_the_ground_count_as_obstacles(
    tmp_path: Path, text: str, edge_m: float | None
) -> None:
    margins = read_lab(lab_folder(tmp_path, GOOD + text)).flight.margins
    assert (margins and margins.edge_m) == edge_m


@pytest.mark.parametrize(("old", "new", "message"), CASES["refused_classes"])
def test_a_mistake_is_reported_with_its_line(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    folder = lab_folder(tmp_path, GOOD.replace(old, new))

    with pytest.raises(FileError, match=message):
        read_lab(folder)


MARK = "mark: {kind: aruco, size_m: [0.4, 0.6], height_m: 0, options: {id: 1, size_m: 0.3}}\n"


def test_a_lab_states_kind_size_and_options_of_its_mark(tmp_path: Path) -> None:
    assert read_lab(lab_folder(tmp_path, GOOD)).mark is None
    assert read_lab(lab_folder(tmp_path, GOOD + MARK)).mark == LandingMark(
        kind="aruco", length_m=0.4, width_m=0.6, height_m=0.0, options={"id": 1, "size_m": 0.3}
    )
    assert default_mark() == LandingMark(length_m=0.5, width_m=0.5, height_m=0.4)


@pytest.mark.parametrize(("mark", "message"), CASES["refused_marks"])
def test_a_wrong_mark_is_refused_with_its_line(tmp_path: Path, mark: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        read_lab(lab_folder(tmp_path, f"{GOOD}mark: {mark}\n"))


def test_the_paper_ships_and_is_the_default() -> None:
    assert "paper" in shipped_labs()
    assert load_lab() is load_lab("paper")


def test_a_lab_of_the_user_is_found_by_name_and_by_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    lab_folder(tmp_path / "labs" / "hall")
    lab_folder(tmp_path / "yard")

    assert load_lab("hall").folder == Path("labs/hall")
    assert load_lab("yard").name == "yard"
    assert load_lab(tmp_path / "yard" / "lab.yaml").name == "yard"
    with pytest.raises(UnknownNameError, match="did you mean 'paper'"):
        load_lab("papr")


def test_a_folder_with_the_name_of_a_shipped_lab_needs_a_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    lab_folder(tmp_path / "labs" / "paper")

    with pytest.raises(InputError, match=r"give the path \./labs/paper for yours"):
        load_lab("paper")
    assert load_lab("labs/paper").classes.names[0] == "wall"
