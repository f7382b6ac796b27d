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
from uav_bt.errors import SceneError

GOOD, MISTAKES = (cases("scenes")[key] for key in ("good", "mistakes"))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return the folder of the scenes of a lab."""
    return write_lab(tmp_path / "hall") / "scenes"


def file_of(folder: Path, name: str, text: str) -> Path:
    """Write a scene, of the lab or beside it."""
    path = (folder if name == "lab" else folder.parent) / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("name", "change", "line", "message"),
    [(name, each[:2], *each[2:]) for name, rows in MISTAKES.items() for each in rows],
)
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
    scene = load_scene(file_of(folder, "paper", GOOD["paper"]))
    first, second = scene.placed
    assert (scene.name, first.spec.position_m, first.spec.yaw_deg) == ("mine", (0.4, 0.9), 20.0)
    assert second.shape.top_class == scene.classes.id_of("roof_2")
    classes = [each.class_id for each in scene.ground_plan.standing]
    assert classes == [*BOXES[:2], None]
    assert (scene.take_off.yaw_deg, scene.take_off.random) == (30.0, False)
    assert [scene.surface_m(*at) for at in ((1.4, 0.9), (-1.9, -1.4), (0, 0))] == [0.8, 0.4, 0.0]
    random = load_scene(
        file_of(folder, "paper", GOOD["paper"].replace("helipad, yaw_deg: 30", "random"))
    )
    assert start_pose(random, seed=1) != start_pose(random, seed=2)


def test_a_scene_without_a_landing_mark_takes_off_from_its_place(folder: Path) -> None:
    scene = load_scene(file_of(folder, "open", GOOD["open"]))
    assert (scene.helipad, scene.mark, scene.start_m) == (None, None, (-1.5, 0.5))
    pose = start_pose(scene, seed=3)
    assert (pose.x_m, pose.y_m, scene.surface_m(pose.x_m, pose.y_m)) == (-1.5, 0.5, 0.0)


def test_a_scene_in_a_lab_s_folder_has_its_ground_mark_light_and_kinds(folder: Path) -> None:
    scene = load_scene(file_of(folder, "lab", GOOD["lab"]))
    assert scene.lab == str(folder.parent)
    assert (scene.ground.size_m, scene.room_size_m) == ((6.0, 4.0), (6.0, 4.0, 4.0))
    assert (scene.helipad.size_m, len(scene.lighting.lamps)) == ((0.5, 0.5, 0.2), 1)
    assert [item.name for item in scene.placed] == ["drum-1", "drum-2", "table-1"]
    assert [each.class_id for each in scene.ground_plan.standing] == [4, 4, 5, None]


def test_movers_have_the_size_of_the_file_or_of_their_kind(folder: Path) -> None:
    first, second = load_scene(file_of(folder, "movers", GOOD["movers"])).movers
    assert (first.shape, first.size_m, first.pattern) == ("cylinder", (0.4, 0.4, 1.7), 3)
    assert (second.shape, second.loop, second.pauses_s) == ("box", False, None)
    (cone,) = load_scene(file_of(folder, "lab", GOOD["lab"])).movers
    assert (cone.shape, cone.size_m) == ("box", (0.6, 0.5, 0.7))


@pytest.mark.parametrize(
    ("kind", "parts", "size_m"), [("table", 5, (0.8, 0.5, 1.0)), ("cone", 2, (0.3, 0.3, 1.4))]
)
def test_an_object_may_state_its_own_size(
    folder: Path, kind: str, parts: int, size_m: tuple[float, float, float]
) -> None:
    text = GOOD["lab"].replace("kind: table,", f"kind: {kind}, size_m: {list(size_m)},")
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
    box = GOOD["paper"].splitlines(keepends=True)[3]
    with pytest.raises(SceneError, match=r"boxes: expected a list of at most 200, got a list"):
        load_scene(file_of(folder, "many", GOOD["paper"].replace(box, 200 * box)))


@pytest.mark.parametrize(("size_m", "room_m"), [((5, 4), (10, 10, 5)), ((12, 6), (17, 11, 5))])
def test_a_ground_has_room_around_it(folder: Path, size_m: object, room_m: object) -> None:
    """At least 2.5 m on each side, and 10 m in all."""
    scene = load_scene(
        file_of(folder, "paper", f"{GOOD['paper']}ground: {{size_m: {list(size_m)}}}\n")
    )
    assert (scene.ground_plan.size_m, scene.room_size_m) == (size_m, room_m)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("[[0.0, -1.2], [0.0, 1.2]]", "[[-0.5, -1.0], [-0.6, -1.0]]"),  # as floats 0.0999... apart
        # A square one would hit the corner of the box, which is 0.48 m away.
        ("[[0.0, -1.2], [0.0, 1.2]]", "[[0.4, 1.018], [1.4, 0.018]], size_m: [0.94, 0.94, 1]"),
    ],
)
def test_a_path_that_is_just_good_is_taken(folder: Path, old: str, new: str) -> None:
    assert load_scene(file_of(folder, "movers", GOOD["movers"].replace(old, new)))
