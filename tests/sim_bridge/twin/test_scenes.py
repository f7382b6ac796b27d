"""Scenes: files are read, mistakes have file, line and remedy, and the ground below is computed."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.model import build_model
from sim_bridge.twin.objects import ObjectSpec, object_names
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene, scene_text
from sim_bridge.twin.variation import start_pose, varied
from tests.paper_lab import BOXES
from tests.sim_bridge.twin.room_world import (
    FURNISHED,
    FURNITURE,
    L_SHAPED,
    LAB,
    START,
    alone,
    body_in,
    scene_of,
)
from tests.worlds import values
from tests.worlds.tables import cases
from uav_bt.errors import SceneError
from uav_bt.mission.covered_ground import CoveredGround, GroundCells
from uav_bt.types import MoverState, Pose

GOOD, MISTAKES = (cases("scenes")[key] for key in ("good", "mistakes"))


def read(hall: Path, name: str, old: str = "", new: str = "") -> Scene:
    """Return the scene of a good file, or of one with another text; `lab` lies in the lab."""
    assert old in GOOD[name]
    path = (hall / "scenes" if name == "lab" else hall) / "mine.yaml"
    path.write_text(GOOD[name].replace(old, new, 1), encoding="utf-8")
    return load_scene(path)


@pytest.mark.parametrize(
    ("name", "change", "line", "message"),
    [(name, each[:2], *each[2:]) for name, rows in MISTAKES.items() for each in rows],
)
def test_a_mistake_is_reported_with_its_line(
    hall: Path, name: str, change: list[str], line: int, message: str
) -> None:
    with pytest.raises(SceneError) as caught:
        read(hall, name, *change)
    problems = str(caught.value)
    assert f"mine.yaml:{line}: " in problems
    assert message in problems


@pytest.mark.parametrize("name", GOOD)
def test_a_scene_is_written_and_read_again(hall: Path, tmp_path: Path, name: str) -> None:
    scene, again = read(hall, name), tmp_path / "mine.yaml"
    again.write_text(scene_text(scene), encoding="utf-8")
    assert load_scene(again) == scene


def test_boxes_and_take_off_are_those_of_the_file(hall: Path) -> None:
    scene = read(hall, "paper")
    first, second = scene.placed
    assert (scene.name, first.spec.position_m, first.spec.yaw_deg) == ("mine", (0.4, 0.9), 20.0)
    assert second.shape.top_class == scene.classes.id_of("roof_2")
    assert [each.class_id for each in scene.ground_plan.standing] == [*BOXES[:2], None]
    assert (scene.take_off.yaw_deg, scene.take_off.random) == (30.0, False)
    assert [scene.surface_m(*at) for at in ((1.4, 0.9), (-1.9, -1.4), (0, 0))] == [0.8, 0.4, 0.0]
    random = read(hall, "paper", "helipad, yaw_deg: 30", "random")
    assert start_pose(random, seed=1) != start_pose(random, seed=2)


@pytest.mark.parametrize(
    ("name", "place_m"), [("paper", (-1.9, -1.4, 0.45)), ("open", (-1.5, 0.5, 0.05))]
)
def test_the_body_stands_on_the_mark_or_at_its_place(
    hall: Path, name: str, place_m: tuple[float, float, float]
) -> None:
    """Its centre is 5 cm above the mark, which is 0.4 m high, or above the ground."""
    scene = read(hall, name)
    pose = start_pose(scene, seed=3)
    assert (pose.x_m, pose.y_m, pose.z_m) == pytest.approx(place_m)
    assert pose.yaw_rad == pytest.approx(math.radians(30.0))
    assert (scene.mark is not None, scene.start_m) == (name == "paper", place_m[:2])


def test_a_scene_in_a_lab_s_folder_has_its_ground_mark_light_and_kinds(hall: Path) -> None:
    scene = read(hall, "lab")
    assert scene.lab == str(hall)
    assert (scene.ground.size_m, scene.room_size_m) == ((6.0, 4.0), (6.0, 4.0, 4.0))
    assert (scene.helipad.size_m, len(scene.lighting.lamps)) == ((0.5, 0.5, 0.2), 1)
    assert [item.name for item in scene.placed] == ["drum-1", "drum-2", "table-1"]
    assert [each.class_id for each in scene.ground_plan.standing] == [4, 4, 5, None]


def test_movers_have_the_size_of_the_file_or_of_their_kind(hall: Path) -> None:
    first, second = read(hall, "movers").movers
    assert (first.shape, first.size_m, first.pattern) == ("cylinder", (0.4, 0.4, 1.7), 3)
    assert (second.shape, second.loop, second.pauses_s) == ("box", False, None)
    (cone,) = read(hall, "lab").movers
    assert (cone.shape, cone.size_m) == ("box", (0.6, 0.5, 0.7))


@pytest.mark.parametrize(
    ("kind", "parts", "size_m"), [("table", 5, (0.8, 0.5, 1.0)), ("cone", 2, (0.3, 0.3, 1.4))]
)
def test_an_object_may_state_its_own_size(
    hall: Path, kind: str, parts: int, size_m: tuple[float, float, float]
) -> None:
    scene = read(hall, "lab", "kind: table,", f"kind: {kind}, size_m: {list(size_m)},")
    standing = scene.placed[2].standing
    outline = standing.footprint
    assert (2 * outline.half_x_m, 2 * outline.half_y_m) == pytest.approx(size_m[:2])
    assert standing.height_m == max(part.top_m for part in standing.parts) == size_m[2]
    assert len(standing.parts) == parts


def test_a_number_distinguishes_boxes_of_one_pattern() -> None:
    boxes = [ObjectSpec(kind=f"box-{k % 8 + 1}", position_m=(0.0, 0.0)) for k in range(17)]
    names = object_names(boxes)
    assert names[:9] == [*(f"box-{k}" for k in range(1, 9)), "box-1-2"]
    assert (names[16], len(set(names))) == ("box-1-3", 17)


def test_more_than_two_hundred_boxes_are_refused(hall: Path) -> None:
    box = GOOD["paper"].splitlines(keepends=True)[3]
    with pytest.raises(SceneError, match=r"boxes: expected a list of at most 200, got a list"):
        read(hall, "paper", box, 200 * box)


@pytest.mark.parametrize(("size_m", "room_m"), [((5, 4), (10, 10, 5)), ((12, 6), (17, 11, 5))])
def test_a_ground_has_room_around_it(hall: Path, size_m: object, room_m: object) -> None:
    """At least 2.5 m on each side, and 10 m in all."""
    scene = read(hall, "paper", "name: mine", f"ground: {{size_m: {list(size_m)}}}")
    assert (scene.ground_plan.size_m, scene.room_size_m) == (size_m, room_m)


@pytest.mark.parametrize(
    "path",
    [
        "[[-0.5, -1.0], [-0.6, -1.0]]",  # as floats 0.0999... m apart
        # A square one would hit the corner of the box, which is 0.48 m away.
        "[[0.4, 1.018], [1.4, 0.018]], size_m: [0.94, 0.94, 1]",
    ],
)
def test_a_path_that_is_just_good_is_taken(hall: Path, path: str) -> None:
    assert read(hall, "movers", "[[0.0, -1.2], [0.0, 1.2]]", path)


@pytest.mark.parametrize(
    ("at_m", "below_m", "surface_m"),
    [((0.1, 0.3), 1.5, 0.8), ((0.1, 0.3), 0.4, 0.0), ((0.5, -0.1), 1.5, 0.0)],
)
def test_the_surface_below_a_body_is_a_top_or_the_ground_below_it(
    hall: Path, at_m: tuple[float, float], below_m: float, surface_m: float
) -> None:
    """A table that moves counts by its parts, as one that stands."""
    standing = alone(hall, "table", yaw_deg=90.0)
    assert standing.surface_m(*at_m, below_m) == pytest.approx(surface_m)
    path = "path_m: [[1.0, -1.0], [0.1, -1.0]], speed_mps: 0.4, yaw_deg: 90"
    moving = scene_of(hall, f"movers: [{{kind: table, {path}}}]\n{START}")
    pose = Pose(x_m=0.1, y_m=-0.1, z_m=0.4, yaw_rad=math.pi / 2)
    state = MoverState(name="mover-1", pose=pose, vx_mps=0.0, vy_mps=0.0)
    assert moving.surface_m(*at_m, below_m, [state]) == pytest.approx(surface_m)


def test_the_ground_below_a_table_is_free_but_hidden_from_above(hall: Path) -> None:
    plan = scene_of(hall, f"objects: [{{kind: table, position_m: [0, 0]}}]\n{START}").ground_plan
    cells = GroundCells(plan)
    assert int((~cells.free).sum()) == 4, "one cell below each leg"
    covered = CoveredGround(plan, anafi_camera(640, 360))
    above = Pose(x_m=0.0, y_m=0.0, z_m=1.6, yaw_rad=0.0)
    covered.add(0.0, values.truth(above, landing_error_m=None, gimbal_pitch_rad=-math.pi / 2))
    x_m, y_m = np.meshgrid(np.abs(cells.x_m), np.abs(cells.y_m))
    assert not covered.seen[(x_m < 0.4) & (y_m < 0.2)].any(), "below the top"
    assert covered.seen[(y_m > 0.75) & (y_m < 0.85) & (x_m < 0.4)].all(), "beyond its shadow"


@pytest.mark.parametrize(
    ("kind", "yaw_deg", "area_m2"), [("rack", 0.0, 1.2 * 0.4), ("drum", 20.0, math.pi * 0.3**2)]
)
def test_shelves_and_drums_cover_their_outline(
    hall: Path, kind: str, yaw_deg: float, area_m2: float
) -> None:
    cells = GroundCells(alone(hall, kind, yaw_deg=yaw_deg).ground_plan)
    assert float((~cells.free).sum()) * 0.05**2 == pytest.approx(area_m2, rel=0.1)


# --- furniture, and what is at a wall -------------------------------------------------------------


def furnished(hall: Path, *items: str, lab: str = FURNISHED) -> Scene:
    (hall / "lab.yaml").write_text(lab, encoding="utf-8")
    return scene_of(hall, f"{START}objects:\n" + "".join(f"  - {{{item}}}\n" for item in items))


@pytest.mark.parametrize("kind", [*FURNITURE, "door", "window"])
def test_furniture_fills_its_size_and_is_touched(hall: Path, kind: str) -> None:
    scene = furnished(hall, f"kind: {kind}, wall: south")
    (item,) = scene.placed
    around, blocks = item.footprint, item.standing.blocks
    assert len(blocks) > 3
    has_top = kind not in {"person", "door", "window"}
    assert sum(part.roofed for part in item.shape.parts) == has_top
    assert max(block.top_m for block in blocks) == pytest.approx(item.standing.height_m)
    for block in blocks:
        x_m, y_m = around.to_body(block.footprint.x_m, block.footprint.y_m)
        assert abs(x_m) + block.footprint.half_x_m <= around.half_x_m + 1e-9
        assert abs(y_m) + block.footprint.half_y_m <= around.half_y_m + 1e-9
    body = body_in(scene)
    share = 0.5 if kind == "chair" else 0.97  # of the height: the seat, or the top
    body.place(around.x_m, around.y_m, share * item.standing.height_m, 0.0)
    assert f"{kind}-1" in body.contacts()


@pytest.mark.parametrize(
    ("place", "pose"),
    [
        ("wall: north, along_m: 1.2", (1.2, 1.975, 0.0)),
        ("wall: east, along_m: 1.2", (2.975, 1.2, -90.0)),
        ("wall: south, along_m: -1", (-1.0, -1.975, 180.0)),
        ("wall: 2, along_m: -1", (-2.975, -1.0, 90.0)),
        ("position_m: [1.3, 2.05]", (1.3, 1.975, 0.0)),
    ],
)
def test_a_door_is_flat_on_its_wall(
    hall: Path, place: str, pose: tuple[float, float, float]
) -> None:
    """It belongs to the wall: maps and the count of objects do not have it."""
    scene = furnished(hall, f"kind: door, {place}")
    (door,) = scene.placed
    assert (door.pose.x_m, door.pose.y_m) == pytest.approx(pose[:2])
    assert math.cos(door.pose.yaw_rad - math.radians(pose[2])) == pytest.approx(1.0)
    assert (door.shape.class_id, scene.ground_plan.standing[0].class_id) == (0, 0)
    assert build_model(scene, drawn=False).obstacle_geoms == ()
    (hall / "again.yaml").write_text(scene_text(scene), encoding="utf-8")
    assert load_scene(hall / "again.yaml") == scene


def test_other_furniture_stands_with_its_back_at_a_wall(hall: Path) -> None:
    """Its front looks into the room; a random room leaves it there."""
    scene = furnished(hall, "kind: shelf, wall: west", "kind: drum, position_m: [1, 0]")
    back = next(part for part in scene.placed[0].shape.parts if part.look == "frame")
    assert back.at(scene.placed[0].pose).footprint.x_m == pytest.approx(-3.0, abs=0.02)
    other = varied(scene, 3, room=True, movers=0)
    assert other.objects[0] == scene.objects[0]
    assert other.objects[1] != scene.objects[1]


@pytest.mark.parametrize(
    ("lab", "item", "message"),
    [
        (FURNISHED, "kind: door, position_m: [1, 0.5]", "on one is [1, 2]; or give 'wall'"),
        (FURNISHED, "kind: door, wall: north, along_m: 3", "at most 2.52 m from the middle"),
        (
            FURNISHED,
            "kind: door, wall: 5",
            "'5' names 0 walls; choose one: 1 (its middle",
        ),
        (FURNISHED, "kind: door, wall: nroth", "got 'nroth'; did you mean 'north'?"),
        (FURNISHED, "kind: shelf, wall: west, yaw_deg: 5", "faces the room: remove 'yaw_deg'"),
        (FURNISHED, "kind: shelf", "needs either position_m or wall"),
        (FURNISHED, "kind: shelf, position_m: [0, 0], along_m: 1", "add 'wall'"),
        (FURNISHED.replace("  walls:", "  # walls:"), "kind: door, wall: west", "add 'walls' to"),
        (
            FURNISHED.replace(LAB[LAB.index("room:") :], L_SHAPED[L_SHAPED.index("room:") :]),
            "kind: shelf, wall: north",
            "2 walls; choose one: 3 (its middle is [1.5, 0]), 5",
        ),
    ],
)
def test_what_cannot_be_at_a_wall_is_refused(hall: Path, lab: str, item: str, message: str) -> None:
    with pytest.raises(SceneError, match=r"mine.yaml:3: objects\[0\]") as caught:
        furnished(hall, item, lab=lab)
    assert message in str(caught.value)


def test_all_faults_of_an_arrangement_come_at_once(hall: Path) -> None:
    movers = "{kind: door, path_m: [[0, -1], [1, -1]], speed_mps: 0.5}"
    items = ("kind: drum, position_m: [5, 0]", "kind: sofa, position_m: [0, 0]")
    with pytest.raises(SceneError) as caught:
        furnished(hall, *items, f"kind: door, position_m: [0, 0]}}\nmovers:\n  - {movers[:-1]}")
    found = [line.split("mine.yaml:")[1] for line in str(caught.value).splitlines()]
    assert [line[:13] for line in found] == [
        *("3: objects[0]", "4: objects[1]", "5: objects[2]", "7: movers[0]:"),
    ]


@pytest.mark.parametrize("step", [1, -1])
def test_what_lies_beyond_an_inner_corner_is_outside(hall: Path, step: int) -> None:
    """The corners may be stated either way round."""
    outline = str([[-3, -2], [3, -2], [3, 0], [0, 0], [0, 2], [-3, 2]][::step])
    (hall / "lab.yaml").write_text(LAB.replace("size_m: [6, 4]", f"outline_m: {outline}"))
    table = "objects: [{kind: table, position_m: [-0.6, 0.5]}]\n"
    body = body_in(scene_of(hall, table + START))
    for x_m, contacts in ((-0.2, ()), (0.0, ("wall-4",))):
        body.place(x_m, 1.2, 1.0, 0.0)
        assert body.contacts() == contacts
    for place in ("[-0.3, 0.2]", "[1, 1]"):  # over the corner, and beyond it
        with pytest.raises(SceneError, match="outside the ground"):
            scene_of(hall, table.replace("[-0.6, 0.5]", place) + START)
