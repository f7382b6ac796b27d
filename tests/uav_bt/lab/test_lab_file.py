"""Labs: their classes, files and names, and the keys that say how a place is flown."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.worlds.labs import LAB, SITE, lab_folder, with_files_of_site
from tests.worlds.tables import cases
from uav_bt.app.site import Site, load_site, site_of_lab
from uav_bt.errors import FileError, InputError, UnknownNameError, ValueRangeError
from uav_bt.lab.classes import (
    GROUND,
    MARK,
    MAX_CLASSES,
    OBSTACLE,
    OUTSIDE,
    LabClass,
    LabClasses,
    RoleName,
)
from uav_bt.lab.lab_file import lab_schema, read_lab
from uav_bt.lab.shipped import default_mark, load_lab
from uav_bt.mission.limits import Limits
from uav_bt.types import LandingMark, Pose2D

PAPER = load_lab("paper").classes


def a_class(name: str, role: RoleName, top: str | None = None) -> LabClass:
    return LabClass(name=name, role=role, colour=(1, 2, 3), top=top)


def on_legs(name: str, role: RoleName, legs_m: float) -> LabClass:
    return replace(a_class(name, role), legs_m=legs_m)


WALL = a_class("wall", "outside")


def test_ids_beyond_the_classes_or_of_another_type_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="must be 0 to 16, got 17"):
        PAPER.roles(np.array([[3, 17]], dtype=np.uint8))
    with pytest.raises(ValueRangeError, match="uint8"):
        PAPER.roles(np.array([1], dtype=np.int64))  # type: ignore[arg-type]
    with pytest.raises(ValueRangeError, match="no class has the role ground"):
        _ = LabClasses([WALL]).ground


def test_the_order_of_the_classes_is_free_behind_the_first_one() -> None:
    classes = LabClasses(
        [WALL, a_class("tag", "mark"), a_class("drum", "obstacle"), a_class("floor", "ground")]
    )
    ids = np.array([0, 1, 2, 3], dtype=np.uint8)
    assert classes.roles(ids).tolist() == [OUTSIDE, MARK, OBSTACLE, GROUND]
    assert (classes.ground, classes.mark_sides, classes.mark_top) == (3, None, 1)


def test_several_ground_classes_become_the_first_one() -> None:
    classes = LabClasses([WALL, a_class("rug", "ground"), a_class("tiles", "ground")])
    ids = np.array([[0, 1, 2]], dtype=np.uint8)
    assert classes.with_one_ground(ids).tolist() == [[0, 1, 1]]
    assert PAPER.with_one_ground(ids) is ids


@pytest.mark.parametrize(
    ("classes", "message"),
    [
        ([], "expected 1 to 64 classes, got 0"),
        ([WALL] + [a_class(f"c{k}", "ground") for k in range(MAX_CLASSES)], "got 65"),
        ([WALL, WALL], "'wall' is listed twice"),
        ([a_class("floor", "ground")], "'floor' has the role ground"),
        ([WALL, a_class("box", "obstacle", "lid"), a_class("lid", "ground")], "same role"),
        ([WALL, a_class("box", "obstacle", "box")], "same role"),
        ([WALL, a_class("box", "obstacle", "lid")], "unknown class 'lid'"),
        ([WALL, on_legs("floor", "ground", 1.0)], "cannot stand on legs"),
        (
            [WALL, a_class("box", "obstacle", "lid"), on_legs("lid", "obstacle", 1.0)],
            "'lid' cannot stand on legs",
        ),
    ],
)
def test_classes_that_make_no_lab_are_refused(classes: list[LabClass], message: str) -> None:
    with pytest.raises((ValueRangeError, UnknownNameError), match=message):
        LabClasses(classes)


# --- lab files ------------------------------------------------------------------------------------

CASES = cases("labs")


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
        (["class: drum, shape: chair"], 1.5),
        (["class: drum, shape: chair", "class: drum, shape: shelf"], 0.0),
    ],
)
def test_tables_and_racks_of_the_room_stand_on_legs(
    tmp_path: Path, kinds: list[str], apart_m: float
) -> None:
    look = "size_m: [0.9, 1.2, 0.8], surface: {colour: '#404040'}"
    objects = "".join(f"    kind_{row}: {{{kind}, {look}}}\n" for row, kind in enumerate(kinds))
    lab = read_lab(lab_folder(tmp_path, f"{LAB}room:\n  objects:\n{objects}"))
    assert lab.classes.legs_m.tolist() == [0.0, 0.0, pytest.approx(apart_m), 0.0]


def test_furniture_has_a_usual_size(tmp_path: Path) -> None:
    """The legs of a round table are at most its diameter apart, 1 m."""
    text = f"{LAB}room: {{objects: {{table: {{class: drum, shape: round_table}}}}}}\n"
    assert read_lab(lab_folder(tmp_path, text)).classes.legs_m.max() == 1.0


@pytest.mark.parametrize(
    ("text", "edge_m"),
    [
        ("room: {walls: {beside_m: 0}}", 0.4),
        ("room: {walls: {beside_m: 0.5}}", None),
        ("room: {walls: {beside_m: 0}}\nmargins: {edge_m: 0.35}", 0.35),
    ],
)
def test_walls_at_the_edge_are_obstacles(tmp_path: Path, text: str, edge_m: float | None) -> None:
    margins = read_lab(lab_folder(tmp_path, LAB + text)).flight.margins
    assert (margins and margins.edge_m) == edge_m


@pytest.mark.parametrize(("old", "new", "message"), CASES["refused_classes"])
def test_a_mistake_is_reported_with_its_line(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    folder = lab_folder(tmp_path, LAB.replace(old, new))
    with pytest.raises(FileError, match=message):
        read_lab(folder)


ARUCO = "mark: {kind: aruco, size_m: [0.4, 0.6], height_m: 0, options: {id: 1, size_m: 0.3}}\n"


def test_a_lab_states_kind_size_and_options_of_its_mark(tmp_path: Path) -> None:
    assert read_lab(lab_folder(tmp_path, LAB)).mark is None
    assert read_lab(lab_folder(tmp_path, LAB + ARUCO)).mark == LandingMark(
        kind="aruco", length_m=0.4, width_m=0.6, height_m=0.0, options={"id": 1, "size_m": 0.3}
    )
    assert default_mark() == LandingMark(length_m=0.5, width_m=0.5, height_m=0.4)


@pytest.mark.parametrize(("mark", "message"), CASES["refused_marks"])
def test_a_wrong_mark_is_refused_with_its_line(tmp_path: Path, mark: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        read_lab(lab_folder(tmp_path, f"{LAB}mark: {mark}\n"))


def test_a_lab_is_found_by_name_and_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    lab_folder(tmp_path / "labs" / "hall")
    lab_folder(tmp_path / "yard")
    assert load_lab("hall").folder == Path("labs/hall")
    assert load_lab("yard").name == "yard"
    assert load_lab(tmp_path / "yard" / "lab.yaml").name == "yard"


def test_a_folder_with_the_name_of_a_shipped_lab_needs_a_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    lab_folder(tmp_path / "labs" / "paper")
    with pytest.raises(InputError, match=r"give the path \./labs/paper for yours"):
        load_lab("paper")
    assert load_lab("labs/paper").classes.names[0] == "wall"


# --- how a place is flown -------------------------------------------------------------------------


def test_a_lab_file_has_the_keys_of_a_site_file(tmp_path: Path) -> None:
    """The same text gives the same site."""
    folder = lab_folder(with_files_of_site(tmp_path / "hall"), LAB + SITE)
    (folder / "site.yaml").write_text(SITE)
    site = site_of_lab(read_lab(folder))
    assert replace(site, depth=None) == load_site(folder / "site.yaml")
    assert (site.lab, site.file) == ("hall", folder / "lab.yaml")
    assert (site.flight_height_m, site.camera) == (1.2, folder / "camera.yaml")
    assert site.take_off_pose == Pose2D(x_m=-1.0, y_m=0.5, yaw_rad=math.radians(90))
    assert site.mark_pose == Pose2D(x_m=1.0, y_m=-1.0, yaw_rad=math.pi)


def test_a_take_off_without_a_position_is_from_the_mark(tmp_path: Path) -> None:
    """A lab with classes only is a site with the network for any room."""
    assert site_of_lab(read_lab(lab_folder(tmp_path))) == Site(model="any", depth="any")
    text = "mark: {size_m: [1, 1], height_m: 0, position_m: [1, -1]}\ntake_off: {yaw_deg: 90}\n"
    site = site_of_lab(read_lab(lab_folder(tmp_path, LAB + text)))
    assert site.take_off_pose == Pose2D(x_m=1.0, y_m=-1.0, yaw_rad=math.radians(90))


@pytest.mark.parametrize(("keys", "message"), CASES["refused_keys"])
def test_what_is_wrong_is_named_with_its_line(tmp_path: Path, keys: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        site_of_lab(read_lab(lab_folder(tmp_path, f"{LAB}{keys}\n")))


def test_the_papers_lab_states_the_defaults() -> None:
    """Its sections are examples and change no flight; a real drone takes off from its box."""
    stated, usual = site_of_lab(load_lab("paper")), Site(limits=Limits())
    assert stated.take_off_surface_m == 0.4
    for name in ("limits", "clearances", "preflight", "video_latency_s", "area", "ground"):
        assert getattr(stated, name) == getattr(usual, name)


# --- the schema for editors -----------------------------------------------------------------------


def test_the_schema_beside_the_shipped_labs_is_current() -> None:
    """`uav-bt lab schema --out labs/lab.schema.json` writes it."""
    paper = load_lab("paper").file
    assert (paper.parents[1] / "lab.schema.json").read_text() == lab_schema()
    assert paper.read_text().startswith("# yaml-language-server: $schema=../lab.schema.json\n")
