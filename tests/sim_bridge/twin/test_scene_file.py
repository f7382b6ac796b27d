"""Scene files: shipped scenes, labs and movers are read; mistakes have file, line and remedy."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_bridge.twin.objects import ObjectSpec, object_names
from sim_bridge.twin.scene_file import load_scene, scene_text
from sim_bridge.twin.variation import start_pose
from tests.paper_lab import BOXES
from tests.sim_bridge.twin.room_world import write_lab
from tests.worlds.tables import cases
from uav_bt.errors import SceneError, UnknownNameError

PAPER = """\
name: mine
helipad: {position_m: [-1.9, -1.4], yaw_deg: 0, size_m: [0.5, 0.5, 0.4]}
boxes:
  - {pattern: 1, position_m: [0.4, 0.9], yaw_deg: 20, size_m: [0.4, 0.35, 1.9]}
  - {pattern: 2, position_m: [1.4, 0.9], size_m: [0.4, 0.35, 0.8]}
lighting: {ambient: 0.35, direction: [0.5, 0.3, -1.0], shadows: false}
take_off: {from: helipad, yaw_deg: 30}
"""
LAB = """\
helipad: {position_m: [2.0, 1.2]}
objects:
  - {kind: drum, position_m: [-1.0, 0.5]}
  - {kind: drum, position_m: [1.0, -1.0]}
  - {kind: table, position_m: [0.2, 0.6], yaw_deg: 30}
movers:
  - {kind: cone, path_m: [[-2.0, -1.4], [0.0, -1.4]], speed_mps: 0.4}
"""
MOVERS = """\
helipad: {position_m: [-2.0, -1.4]}
boxes:
  - {pattern: 1, position_m: [1.5, 1.0], size_m: [0.4, 0.4, 1.8]}
movers:
  - {path_m: [[0.0, -1.2], [0.0, 1.2]], speed_mps: 0.5, pattern: 3}
  - {shape: box, path_m: [[1.0, -1.0], [2.0, -1.0]], speed_mps: 0.3, size_m: [0.5, 0.3, 0.9]}
take_off: {from: [-1.0, 0.0], yaw_deg: 0}
"""
TAG = """\
helipad: {position_m: [0, 1], size_m: [1, 1, 0], kind: apriltag, options: {id: 3, size_m: 0.4}}
"""
OPEN = """\
boxes: [{pattern: 2, position_m: [1.0, -1.0], size_m: [0.4, 0.4, 1.0]}]
take_off: {from: [-1.5, 0.5], yaw_deg: 30}
"""
GOOD = {"paper": PAPER, "lab": LAB, "movers": MOVERS, "tag": TAG, "open": OPEN}
MISTAKES = [
    (name, change, line, message)
    for name, rows in cases("scenes").items()
    for *change, line, message in rows
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return the folder of the scenes of a lab."""
    return write_lab(tmp_path / "hall") / "scenes"


def file_of(folder: Path, name: str, text: str) -> Path:
    """Write a scene, of the lab or beside it."""
    path = (folder if name == "lab" else folder.parent) / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(("name", "change", "line", "message"), MISTAKES)
def test_a_mistake_is_reported_with_its_line(
    folder: Path, name: str, change: list[str], line: int, message: str
) -> None:
    old, new = change
    assert old in GOOD[name]
    path = file_of(folder, name, GOOD[name].replace(old, new, 1))
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert any(one.startswith(f"{path}:{line}: ") for one in str(caught.value).splitlines())
    assert message in str(caught.value)


@pytest.mark.parametrize("name", GOOD)
def test_a_scene_is_written_and_read_again(folder: Path, tmp_path: Path, name: str) -> None:
    scene = load_scene(file_of(folder, name, GOOD[name]))
    again = tmp_path / "mine.yaml"
    again.write_text(scene_text(scene), encoding="utf-8")
    assert load_scene(again) == scene


def test_boxes_and_take_off_are_those_of_the_file(folder: Path) -> None:
    scene = load_scene(file_of(folder, "paper", PAPER))
    first, second = scene.placed
    assert (scene.name, first.spec.position_m, first.spec.yaw_deg) == ("mine", (0.4, 0.9), 20.0)
    assert second.shape.top_class == scene.classes.id_of("roof_2")
    classes = [each.class_id for each in scene.ground_plan.standing]
    assert classes == [*BOXES[:2], None]
    assert (scene.take_off.yaw_deg, scene.take_off.random) == (30.0, False)
    assert [scene.surface_m(*at) for at in ((1.4, 0.9), (-1.9, -1.4), (0, 0))] == [0.8, 0.4, 0.0]
    random = load_scene(file_of(folder, "paper", PAPER.replace("helipad, yaw_deg: 30", "random")))
    assert start_pose(random, seed=1) != start_pose(random, seed=2)


def test_a_scene_without_a_landing_mark_takes_off_from_its_place(folder: Path) -> None:
    scene = load_scene(file_of(folder, "open", OPEN))
    assert (scene.helipad, scene.mark, scene.start_m) == (None, None, (-1.5, 0.5))
    pose = start_pose(scene, seed=3)
    assert (pose.x_m, pose.y_m, scene.surface_m(pose.x_m, pose.y_m)) == (-1.5, 0.5, 0.0)


def test_a_scene_in_a_lab_s_folder_has_its_ground_mark_light_and_kinds(folder: Path) -> None:
    scene = load_scene(file_of(folder, "lab", LAB))
    assert scene.lab == str(folder.parent)
    assert (scene.ground.size_m, scene.room_size_m) == ((6.0, 4.0), (6.0, 4.0, 4.0))
    assert (scene.helipad.size_m, len(scene.lighting.lamps)) == ((0.5, 0.5, 0.2), 1)
    assert [item.name for item in scene.placed] == ["drum-1", "drum-2", "table-1"]
    assert [each.class_id for each in scene.ground_plan.standing] == [4, 4, 5, None]


def test_movers_have_the_size_of_the_file_or_of_their_kind(folder: Path) -> None:
    first, second = load_scene(file_of(folder, "movers", MOVERS)).movers
    assert (first.shape, first.size_m, first.pattern) == ("cylinder", (0.4, 0.4, 1.7), 3)
    assert (second.shape, second.loop, second.pauses_s) == ("box", False, None)
    (cone,) = load_scene(file_of(folder, "lab", LAB)).movers
    assert (cone.shape, cone.size_m) == ("box", (0.6, 0.5, 0.7))


@pytest.mark.parametrize(
    ("kind", "parts", "size_m"), [("table", 5, (0.8, 0.5, 1.0)), ("cone", 2, (0.3, 0.3, 1.4))]
)
def test_an_object_may_state_its_own_size(
    folder: Path, kind: str, parts: int, size_m: tuple[float, float, float]
) -> None:
    text = LAB.replace("kind: table,", f"kind: {kind}, size_m: {list(size_m)},")
    standing = load_scene(file_of(folder, "lab", text)).placed[2].standing
    outline = standing.footprint
    assert (2 * outline.half_x_m, 2 * outline.half_y_m) == pytest.approx(size_m[:2])
    assert standing.height_m == max(part.top_m for part in standing.parts) == size_m[2]
    assert len(standing.parts) == parts


def test_a_number_distinguishes_boxes_of_one_pattern() -> None:
    boxes = [ObjectSpec(kind=f"box-{k % 8 + 1}", position_m=(0.0, 0.0)) for k in range(17)]
    names = object_names(boxes)
    assert names[:9] == [*(f"box-{k}" for k in range(1, 9)), "box-1-2"]
    assert (names[16], len(set(names))) == ("box-1-3", 17)


def test_more_than_two_hundred_boxes_are_refused(folder: Path) -> None:
    box = PAPER.splitlines(keepends=True)[3]
    with pytest.raises(SceneError, match=r"boxes: expected a list of at most 200, got a list"):
        load_scene(file_of(folder, "many", PAPER.replace(box, 200 * box)))


@pytest.mark.parametrize(("size_m", "room_m"), [((5, 4), (10, 10, 5)), ((12, 6), (17, 11, 5))])
def test_a_ground_has_room_around_it(folder: Path, size_m: object, room_m: object) -> None:
    """At least 2.5 m on each side, and 10 m in all."""
    scene = load_scene(file_of(folder, "paper", f"{PAPER}ground: {{size_m: {list(size_m)}}}\n"))
    assert (scene.ground_plan.size_m, scene.room_size_m) == (size_m, room_m)


def test_an_unknown_scene_is_refused_with_a_suggestion() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'val-a'"):
        load_scene("vall-a")


def test_corners_of_a_path_may_be_exactly_a_tenth_of_a_metre_apart(folder: Path) -> None:
    """Between -0.5 and -0.6 the floats are 0.0999... apart."""
    text = MOVERS.replace("[[0.0, -1.2], [0.0, 1.2]]", "[[-0.5, -1.0], [-0.6, -1.0]]")
    assert len(load_scene(file_of(folder, "movers", text)).movers) == 2


def test_a_round_mover_may_pass_a_corner_that_a_square_one_would_hit(folder: Path) -> None:
    """Its radius is less than the gap to the box's corner; half a square's diagonal is more."""
    text = MOVERS.replace("[[0.0, -1.2], [0.0, 1.2]]", "[[0.4, 1.018], [1.4, 0.018]]")
    text = text.replace("pattern: 3", "size_m: [0.94, 0.94, 1]")  # the gap is 0.48 m
    load_scene(file_of(folder, "movers", text))
    with pytest.raises(SceneError, match="through box-1"):
        load_scene(file_of(folder, "movers", text.replace("- {path_m", "- {shape: box, path_m", 1)))
