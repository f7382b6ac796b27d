"""Scenes in a lab with a room: refusals, contacts, ground computations, light and variations."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.flying_body import FlyingBody
from sim_bridge.twin.layout import LabGround, layout_problem
from sim_bridge.twin.meshes import triangulated
from sim_bridge.twin.model import build_model
from sim_bridge.twin.placed import ObjectSpec
from sim_bridge.twin.render import Renderer
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene, scene_text
from sim_bridge.twin.variation import start_pose, varied
from sim_bridge.twin.views import sample_flight_poses
from tests.sim_bridge.twin.room_world import LAB, alone, scene_of, write_lab
from tests.worlds import values
from uav_bt.errors import FileError, SceneError, ValueRangeError
from uav_bt.mission.covered_ground import CoveredGround, GroundCells
from uav_bt.types import Pose

GOOD = """\
helipad: {position_m: [2.0, 1.2]}
objects:
  - {kind: drum, position_m: [-1.0, 0.5]}
  - {kind: drum, position_m: [1.0, -1.0]}
  - {kind: table, position_m: [0.2, 0.6], yaw_deg: 30}
movers:
  - {kind: cone, path_m: [[-2.0, -1.4], [0.0, -1.4]], speed_mps: 0.4}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_lab(tmp_path / "hall")


def test_a_scene_in_a_lab_s_folder_has_its_ground_mark_light_and_kinds(folder: Path) -> None:
    scene = scene_of(folder, GOOD)
    assert scene.lab == str(folder)
    assert scene.ground == LabGround(size_m=(6.0, 4.0))
    assert scene.room_size_m == (6.0, 4.0, 4.0)
    assert scene.helipad is not None
    assert scene.helipad.size_m == (0.5, 0.5, 0.2)
    assert len(scene.lighting.lamps) == 1
    assert [item.name for item in scene.placed] == ["drum-1", "drum-2", "table-1"]
    assert [each.class_id for each in scene.ground_plan.standing] == [4, 4, 5, None]


def test_a_scene_of_a_lab_is_written_and_read_again(folder: Path, tmp_path: Path) -> None:
    scene = scene_of(folder, GOOD)
    again = tmp_path / "again.yaml"
    again.write_text(scene_text(scene), encoding="utf-8")
    assert load_scene(again) == scene


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("kind: table", "kind: tabel", 5, "objects[2]: unknown kind of object 'tabel'; did you me"),
        ("[1.0, -1.0]", "[-0.7, 0.5]", 4, "objects[1]: drum-2 overlaps drum-1"),
        ("[1.0, -1.0]", "[0.5, 0.4]", 5, "objects[2]: table-1 overlaps drum-2"),
        ("[1.0, -1.0]", "[2.2, 1.0]", 4, "objects[1]: drum-2 overlaps the landing mark"),
        ("[1.0, -1.0]", "[2.8, -1.0]", 4, "drum-2 at [2.8, -1] stands outside the ground"),
        ("[1.0, -1.0]", "[1.0]", 4, "objects[1].position_m: expected a list of 2"),
        ("kind: cone", "kind: con", 7, "movers[0]: unknown kind of object 'con'"),
        ("kind: cone", "kind: cone, size_m: [1, 1, 1]", 7, "is that of its kind, [0.6, 0.5, 0.7]"),
        ("[0.0, -1.4]", "[-1.0, 1.5]", 7, "movers[0]: mover-1: its path leads through drum-1"),
        ("movers:", "ground: {size_m: [5, 4]}\nmovers:", 6, "states its ground: remove this key"),
        (
            "movers:",
            "boxes: [{pattern: 3, position_m: [2, -1], size_m: [1, 1, 1]}]\nmovers:",
            6,
            "has no class for pattern 3, only 2 classes: use the kinds of its 'room'",
        ),
        ("helipad:", "lab: nowhere\nhelipad:", 1, "unknown lab 'nowhere'"),
        ("[2.0, 1.2]}", "[2.0, 1.2], kind: hat}", 1, "helipad: "),
    ],
)
def test_a_mistake_is_reported_with_its_line(
    folder: Path, old: str, new: str, line: int, message: str
) -> None:
    assert old in GOOD
    with pytest.raises(SceneError) as caught:
        scene_of(folder, GOOD.replace(old, new))
    assert caught.value.line == line
    assert message in str(caught.value)


def test_objects_need_a_lab_with_kinds() -> None:
    with pytest.raises(
        ValueRangeError, match="the lab 'paper' has no kinds of objects: add 'room'"
    ):
        replace(load_scene("train-a"), objects=(ObjectSpec(kind="drum", position_m=(0.0, 0.0)),))


def test_the_ground_of_a_scene_is_that_of_its_lab() -> None:
    with pytest.raises(ValueRangeError, match="the lab 'depot' states its ground"):
        Scene(name="wrong", lab="depot", helipad=load_scene("depot-train-a").helipad)


def test_a_picture_that_is_cut_off_is_refused_when_it_is_drawn(folder: Path) -> None:
    data = (folder / "wood.png").read_bytes()
    (folder / "wood.png").write_bytes(data[:40])
    with pytest.raises(FileError, match=r"wood.png: is a damaged picture"):
        build_model(alone(folder, "crate"))


# --- contacts -------------------------------------------------------------------------------------


def touched(scene: Scene, x_m: float, y_m: float, z_m: float) -> tuple[str, ...]:
    body = FlyingBody(build_model(scene, drawn=False), lag_s=0.1)
    body.place(x_m, y_m, z_m, 0.0)
    return body.contacts()


@pytest.mark.parametrize(
    ("x_m", "z_m", "contacts"),
    [
        (0.0, 1.0, ()),  # above the top at 0.8 m
        (0.0, 0.8, ("table-1",)),  # in the top
        (0.0, 0.4, ()),  # below it, between the legs
        (0.43, 0.4, ("table-1",)),  # in a leg
    ],
)
def test_a_table_is_its_legs_and_its_top(
    folder: Path, x_m: float, z_m: float, contacts: tuple[str, ...]
) -> None:
    item = "{kind: table, position_m: [0, 0]}"
    scene = scene_of(folder, f"objects: [{item}]\ntake_off: {{from: [-2.5, -1.5]}}\n")
    y_m = 0.23 if x_m else 0.0  # a leg stands 0.05 m within the edge
    assert touched(scene, x_m, y_m, z_m) == contacts


def test_each_piece_of_a_mesh_is_touched_and_the_gap_is_free(folder: Path) -> None:
    item = "{kind: cone, position_m: [0, 0]}"
    scene = scene_of(folder, f"objects: [{item}]\ntake_off: {{from: [-2.5, -1.5]}}\n")
    assert touched(scene, -0.15, 0.0, 0.3) == ("cone-1",)
    assert touched(scene, 0.2, -0.2, 0.1) == ("cone-1",)
    assert touched(scene, 0.1, 0.25, 0.6) == ()


def test_the_surface_below_a_body_is_a_top_or_the_ground_below_it(folder: Path) -> None:
    item = "{kind: table, position_m: [0, 0]}"
    scene = scene_of(folder, f"objects: [{item}]\ntake_off: {{from: [-2.5, -1.5]}}\n")
    assert scene.surface_m(0.0, 0.0) == pytest.approx(0.8)
    assert scene.surface_m(0.0, 0.0, 1.5) == pytest.approx(0.8)
    assert scene.surface_m(0.0, 0.0, 0.4) == 0.0
    assert scene.surface_m(0.6, 0.0) == 0.0


# --- ground computations --------------------------------------------------------------------------


def test_the_ground_below_a_table_is_free_but_hidden_from_above(folder: Path) -> None:
    item = "{kind: table, position_m: [0, 0]}"
    scene = scene_of(folder, f"objects: [{item}]\ntake_off: {{from: [-2.5, -1.5]}}\n")
    plan = scene.ground_plan
    cells = GroundCells(plan)
    assert int((~cells.free).sum()) == 4, "one cell below each leg"
    covered = CoveredGround(plan, anafi_camera(640, 360))
    truth = values.truth(
        Pose(x_m=0.0, y_m=0.0, z_m=1.6, yaw_rad=0.0),
        landing_error_m=None,
        gimbal_pitch_rad=-math.pi / 2,
    )
    covered.add(0.0, truth)
    x_m, y_m = np.meshgrid(np.abs(cells.x_m), np.abs(cells.y_m))
    assert not covered.seen[(x_m < 0.4) & (y_m < 0.2)].any(), "below the top"
    assert covered.seen[(y_m > 0.75) & (y_m < 0.85) & (x_m < 0.4)].all(), "beyond its shadow"


def test_shelves_near_the_ground_leave_none_of_it_free(folder: Path) -> None:
    scene = alone(folder, "rack", yaw_deg=0.0)
    covered_m2 = float((~GroundCells(scene.ground_plan).free).sum()) * 0.05**2
    assert covered_m2 == pytest.approx(1.2 * 0.4, rel=0.15)


def test_a_drum_covers_a_circle(folder: Path) -> None:
    scene = alone(folder, "drum")
    covered_m2 = float((~GroundCells(scene.ground_plan).free).sum()) * 0.05**2
    assert covered_m2 == pytest.approx(math.pi * 0.3**2, rel=0.05)


@pytest.mark.parametrize("turn", [0, 2, 5])
def test_a_polygon_is_cut_into_triangles_of_its_area(turn: int) -> None:
    corners = [(-3.0, -2.0), (3.0, -2.0), (3.0, 0.0), (0.0, 0.0), (0.0, 1.0), (0.0, 2.0), (-3, 2.0)]
    outline = corners[turn:] + corners[:turn]
    area = 0.0
    for a, b, c in triangulated(outline):
        (ax, ay), (bx, by), (cx, cy) = outline[a], outline[b], outline[c]
        part = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        assert part > 0.0
        area += part / 2
    assert area == pytest.approx(18.0)


def test_an_object_beyond_the_inner_corner_of_a_polygon_stands_outside(tmp_path: Path) -> None:
    outline = "[[-3, -2], [3, -2], [3, 0], [0, 0], [0, 2], [-3, 2]]"
    text = LAB.replace("size_m: [6, 4], surface", f"outline_m: {outline}, surface")
    folder = write_lab(tmp_path / "corner", text)
    start = "take_off: {from: [-2.5, -1.5]}\n"
    scene_of(folder, f"objects: [{{kind: table, position_m: [-0.6, 0.5]}}]\n{start}")
    for place in ("[-0.3, 0.2]", "[1, 1]"):  # over the corner, and beyond it
        with pytest.raises(SceneError, match="outside the ground"):
            scene_of(folder, f"objects: [{{kind: table, position_m: {place}}}]\n{start}")


# --- light, many objects, variations --------------------------------------------------------------


def test_the_ground_is_brighter_below_a_lamp(folder: Path) -> None:
    scene = scene_of(folder, "take_off: {from: [-2.5, -1.5]}\n")
    means = []
    with Renderer(build_model(scene)) as renderer:
        for x_m in (-2.0, 2.0):
            pose = CameraPose(x_m=x_m, y_m=0.0, z_m=1.0, yaw_rad=0.0, pitch_rad=-math.pi / 2)
            means.append(float(renderer.rgb(pose, 160, 90).mean()))
    assert means[0] > 1.3 * means[1]


def test_classes_are_exact_with_more_surfaces_than_one_byte_counts(folder: Path) -> None:
    small = LAB.replace("size_m: [6, 4]", "size_m: [20, 20]")
    (folder / "lab.yaml").write_text(small, encoding="utf-8")
    text = "objects:\n" + "".join(
        f"  - {{kind: drum, position_m: [{-8 + 1.2 * k:.1f}, {-7 + 1.2 * row:.1f}]}}\n"
        for row in range(12)
        for k in range(12)
    )
    scene = scene_of(folder, f"{text}take_off: {{from: [-9.0, -9.0]}}\n")
    lab = build_model(scene)
    assert (lab.model.geom_group == 0).sum() > 256
    last = scene.placed[-1].spec.position_m
    pose = CameraPose(x_m=last[0] - 1.0, y_m=last[1], z_m=1.6, yaw_rad=0.0, pitch_rad=-0.7)
    with Renderer(lab) as renderer:
        ids = renderer.class_ids(pose, 160, 90)
    assert {4, 6} <= set(np.unique(ids).tolist()) <= {0, 1, 4, 6}


@pytest.mark.parametrize("seed", [1, 2])
def test_objects_and_lamps_are_varied_and_movers_are_of_moving_kinds(seed: int) -> None:
    own = load_scene("depot-val-a")
    scene = varied(own, seed, room=True, movers=2)
    assert [each.kind for each in scene.objects] == [each.kind for each in own.objects]
    assert scene.objects != own.objects
    assert layout_problem(scene.helipad, (), scene.ground, scene.placed) is None
    assert scene.lighting != own.lighting
    assert {mover.kind for mover in scene.movers} <= {"person", "cart"}
    assert varied(own, seed, room=True, movers=2) == scene


def test_random_starts_and_views_keep_away_from_objects() -> None:
    scene = load_scene("depot-test-a")
    poses = sample_flight_poses(scene, np.random.default_rng(0), 14)
    lab = build_model(scene, drawn=False)
    for pose in poses:
        body = FlyingBody(lab, lag_s=0.1)
        body.place(pose.x_m, pose.y_m, pose.z_m, pose.yaw_rad)
        assert body.contacts() == ()
    anywhere = replace(scene, take_off=replace(scene.take_off, random=True, position_m=None))
    for seed in range(5):
        start = start_pose(anywhere, seed)
        gaps_m = [item.footprint.distance_m(start.x_m, start.y_m) for item in scene.placed]
        assert min(gaps_m) >= 0.5


def test_a_model_without_images_has_the_same_contacts() -> None:
    scene = load_scene("depot-train-a")
    drawn, plain = build_model(scene), build_model(scene, drawn=False)
    names = [
        [lab.model.geom(k).name for k in range(lab.model.ngeom) if lab.model.geom_group[k] == 3]
        for lab in (drawn, plain)
    ]
    assert names[0] == names[1]
    assert plain.model.ntex == 0
    assert mujoco.mj_id2name(plain.model, mujoco.mjtObj.mjOBJ_GEOM, plain.hull_geom) == "drone"
