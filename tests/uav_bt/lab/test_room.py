"""The section `room` of a lab file: mistakes are refused with file and line."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from tests.sim_bridge.twin.room_world import CONE, LAB, write_lab
from tests.worlds.tables import cases
from uav_bt.errors import FileError
from uav_bt.lab.lab_file import read_lab
from uav_bt.lab.obj_file import pieces, read_obj
from uav_bt.lab.surface import check_picture

CASES = cases("labs")


def line_of(text: str, word: str) -> int:
    return next(number for number, line in enumerate(text.splitlines(), 1) if word in line)


def test_a_room_gives_kinds_ground_walls_and_light(tmp_path: Path) -> None:
    lab = read_lab(write_lab(tmp_path / "hall"))
    assert lab.room is not None
    section = lab.room.section
    assert list(section.objects) == ["drum", "crate", "table", "rack", "cone"]
    assert section.ground is not None
    assert section.ground.extent_m == (6.0, 4.0)
    assert lab.room.meshes["cone"].shape == (10, 3, 3)


@pytest.mark.parametrize(("old", "new", "message"), CASES["refused_rooms"])
def test_a_mistake_in_a_room_is_reported_with_its_line(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    assert old in LAB
    text = LAB.replace(old, new)
    folder = write_lab(tmp_path / "hall", text)
    with pytest.raises(FileError) as caught:
        read_lab(folder)
    assert message in str(caught.value)
    assert str(caught.value).startswith(f"{folder / 'lab.yaml'}:")
    assert abs((caught.value.line or 0) - line_of(LAB, old.splitlines()[0].strip()[:12])) <= 7


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("shape: chair", "lacks the key 'class'"),
        ("class: drum, shape: box", "lacks the key 'size_m'"),
        ("class: drum, shape: box, size_m: [1, 1, 1]", "lacks the key 'surface'"),
        ("class: floor, shape: door", "'floor' has the role ground"),
        ("class: hall, shape: chair", "'hall' has the role outside"),
        ("shape: door, moves: true", "a door does not move"),
        ("class: drum, shape: chair, above_floor_m: 1", "a chair stands on the floor"),
        ('class: drum, shape: person, top: {colour: "#000000"}', "has no upper face of its own"),
        ('class: drum, shape: cabinet, frame: {colour: "#000000"}', "has no legs, posts or frame"),
        ("class: drum, shape: round_table, size_m: [1, 2, 1]", "as wide as it is long"),
    ],
)
def test_furniture_that_cannot_be_is_refused(tmp_path: Path, kind: str, message: str) -> None:
    folder = write_lab(tmp_path / "hall", f"{LAB}    thing: {{{kind}}}\n")
    with pytest.raises(FileError, match=r"lab.yaml:29: room.objects.thing") as caught:
        read_lab(folder)
    assert message in str(caught.value)


def test_furniture_has_usual_looks_that_a_kind_may_change(tmp_path: Path) -> None:
    """A table or rack with a surface has legs of this look, as ever."""
    shapes = ("chair", "table", "box")
    size = 'size_m: [1, 1, 1], surface: {colour: "#112233"}'
    kinds = "".join(f"    a_{each}: {{class: drum, shape: {each}, {size}}}\n" for each in shapes)
    room = read_lab(write_lab(tmp_path / "hall", f"{LAB}{kinds}    door: {{shape: door}}\n")).room
    assert room is not None
    looks = [room.section.objects[f"a_{each}"] for each in shapes]
    assert {each.surface.colour for each in looks} == {"#112233"}
    assert [each.frame is None for each in looks] == [False, True, True]
    door = room.section.objects["door"]
    assert (door.size_m[2], door.frame is None) == (2.05, False)


def test_a_link_out_of_the_lab_is_refused(tmp_path: Path) -> None:
    folder = write_lab(tmp_path / "hall")
    (folder / "wood.png").rename(tmp_path / "wood.png")
    (folder / "wood.png").symlink_to(tmp_path / "wood.png")
    with pytest.raises(FileError, match=r"lab.yaml:18: room.objects.crate.surface.image: exp"):
        read_lab(folder)


# --- meshes ---------------------------------------------------------------------------------------


def test_a_mesh_is_fitted_to_its_size_and_falls_into_pieces(tmp_path: Path) -> None:
    path = tmp_path / "cone.obj"
    path.write_text(CONE, encoding="utf-8")
    triangles = read_obj(path, (0.6, 0.5, 0.7))
    assert triangles.min(axis=(0, 1)) == pytest.approx((-0.3, -0.25, 0.0))
    assert triangles.max(axis=(0, 1)) == pytest.approx((0.3, 0.25, 0.7))
    assert [len(piece) for piece in pieces(triangles)] == [6, 4]
    turned = "\n".join(
        " ".join(["f", *line.split()[:0:-1]]) if line.startswith("f") else line
        for line in CONE.splitlines()
    )
    path.write_text(turned, encoding="utf-8")
    outwards = read_obj(path, (0.6, 0.5, 0.7))
    volumes = [
        float(np.einsum("ij,ij->i", each[:, 0], np.cross(each[:, 1], each[:, 2])).sum())
        for each in (triangles, outwards)
    ]
    assert volumes[0] == pytest.approx(volumes[1])
    assert volumes[0] > 0.0


def test_a_vertex_that_no_face_uses_does_not_count_for_the_size(tmp_path: Path) -> None:
    path = tmp_path / "cone.obj"
    path.write_text(f"{CONE}v 1000 0 0\n", encoding="utf-8")
    assert read_obj(path, (0.6, 0.5, 0.7)).max(axis=(0, 1)) == pytest.approx((0.3, 0.25, 0.7))


@pytest.mark.parametrize("first", range(6))
@pytest.mark.parametrize("axes", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
def test_a_concave_face_is_cut_along_its_outline(
    tmp_path: Path, first: int, axes: tuple[int, int, int]
) -> None:
    """An L of 3 m2, 1 m high, in every direction: its surface is that of an L."""
    outline = [(2, 0), (2, 1), (1, 1), (1, 2), (0, 2), (0, 0)]
    outline = outline[first:] + outline[:first]
    corners = np.array([(x, y, z) for z in (0, 1) for x, y in outline])[:, axes]
    faces = [[6, 5, 4, 3, 2, 1], [7, 8, 9, 10, 11, 12]]
    faces += [[k + 1, (k + 1) % 6 + 1, (k + 1) % 6 + 7, k + 7] for k in range(6)]
    lines = [("v", *corner) for corner in corners] + [("f", *face) for face in faces]
    path = tmp_path / "l.obj"
    path.write_text("\n".join(" ".join(map(str, line)) for line in lines), encoding="utf-8")
    triangles = read_obj(path, tuple(np.array((2.0, 2.0, 1.0))[list(axes)]))
    a, b, c = np.moveaxis(triangles, 1, 0)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(14.0)
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (CONE.replace("f 1 2 5\n", ""), "not closed: the edge between the vertices 2 and 1"),
        (CONE.replace("f 1 2 5", "f 1 2 50"), ":8: expected 'v X Y Z' or 'f 1 2 3 ...'"),
        (CONE.replace("v 0 0 0", "vp 0 0"), ":2: expected"),
        ("", "has 0 triangles"),
        (CONE.replace("0.5 0.5 1", "0.5 0.5 0").replace("0.2 0.6", "0.2 0"), "flat"),
        (CONE.replace("1.75 0.2 0.6", "1.75 0.2 0"), "a piece of the mesh is flat"),
        ("v 0 0 0\n" * 3 + "f 1 2 3\n" * 4001, "more than 4000 triangles"),
        ("#" * 1_000_001, "larger than 1000000 bytes: simplify the mesh"),
    ],
)
def test_a_bad_mesh_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "bad.obj"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FileError) as caught:
        read_obj(path, (1.0, 1.0, 1.0))
    assert message in str(caught.value)


# --- pictures -------------------------------------------------------------------------------------


def png(width: int, height: int) -> bytes:
    return (
        b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + b"IHDR" + struct.pack(">II", width, height)
    )


def jpeg(width: int, height: int) -> bytes:
    table = b"\xff\xe0" + struct.pack(">H", 4) + b"JF"
    frame = b"\xff\xc2" + struct.pack(">HBHH", 11, 8, height, width)
    return b"\xff\xd8" + table + frame + bytes(8)


@pytest.mark.parametrize("made", [png, jpeg])
def test_the_size_of_a_picture_comes_from_its_header(tmp_path: Path, made: object) -> None:
    """The files have no content: nothing is unpacked."""
    path = tmp_path / "picture"
    path.write_bytes(made(4096, 20))  # type: ignore[operator]
    check_picture(path)
    path.write_bytes(made(30, 50_000))  # type: ignore[operator]
    with pytest.raises(FileError, match="30x50000 pixels: at most 4096"):
        check_picture(path)
