"""Scene files: shipped scenes are flyable; each mistake is reported with file, line and remedy."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from sim_bridge.twin.objects import box_names
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene, scene_names, scene_text
from sim_bridge.twin.variation import start_pose, varied
from sim_bridge.twin.views import sample_flight_poses
from tests.paper_lab import BOXES
from uav_bt.errors import SceneError, UnknownNameError, ValueRangeError
from uav_bt.types.ground import Footprint

SCENES = Path(__file__).parents[3] / "benchmarks" / "scenes"
GOOD = """\
name: mine
helipad: {position_m: [-1.9, -1.4], yaw_deg: 0, size_m: [0.5, 0.5, 0.4]}
boxes:
  - {pattern: 1, position_m: [0.4, 0.9], yaw_deg: 20, size_m: [0.4, 0.35, 1.9]}
  - {pattern: 2, position_m: [1.4, 0.9], size_m: [0.4, 0.35, 0.8]}
lighting: {ambient: 0.35, direction: [0.5, 0.3, -1.0], shadows: false}
take_off: {from: helipad, yaw_deg: 30}
"""


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def gap_m(a: Footprint, b: Footprint) -> float:
    """Return the distance of two rectangles, which is at a corner of one of them."""
    return min(
        one.distance_m(*place) for one, other in ((a, b), (b, a)) for place in other.corners()
    )


PAPER = ("train-a", "train-b", "train-c", "train-d", "val-a", "val-b", "test-a", "test-b")
DEPOT = tuple(
    f"depot-{each}" for each in ("train-a", "train-b", "train-c", "val-a", "test-a", "test-b")
)


def test_eight_scenes_of_the_paper_and_six_of_the_depot_ship() -> None:
    assert set(scene_names()) == {*PAPER, *DEPOT}


@pytest.mark.parametrize("name", PAPER)
def test_a_shipped_scene_is_a_lab_to_fly_in(name: str) -> None:
    """Eight boxes, four of them tall with gaps to pass, and free space around the pad."""
    scene = load_scene(name)
    assert scene.name == name
    assert sorted(box.pattern for box in scene.boxes) == list(range(1, 9))
    heights = [box.size_m[2] for box in scene.boxes]
    assert min(heights) >= 0.6
    assert max(heights) <= 2.2
    assert sum(height >= 1.5 for height in heights) >= 4
    tall = [box.footprint for box in scene.boxes if box.size_m[2] >= 1.3]
    assert all(gap_m(a, b) >= 0.9 for a, b in itertools.combinations(tall, 2))
    assert all(gap_m(box.footprint, scene.helipad.footprint) >= 0.7 for box in scene.boxes)
    x, y = scene.helipad.position_m
    assert abs(x) <= 2.5 - 0.6
    assert abs(y) <= 2.0 - 0.6


def test_a_file_of_one_s_own_is_read(tmp_path: Path) -> None:
    """Each field has the value of the file."""
    scene = load_scene(written(tmp_path, GOOD))
    assert scene.name == "mine"
    assert scene.boxes[0].position_m == (0.4, 0.9)
    assert scene.boxes[0].yaw_deg == 20.0
    assert scene.boxes[1].roof == 2
    assert scene.take_off.yaw_deg == 30.0
    assert not scene.take_off.random
    assert scene.surface_m(1.4, 0.9) == 0.8
    assert scene.surface_m(-1.9, -1.4) == 0.4
    assert scene.surface_m(0.0, 0.0) == 0.0


def test_take_off_is_from_the_helipad_unless_it_says_otherwise(tmp_path: Path) -> None:
    text = "helipad: {position_m: [1.0, 1.0]}\ntake_off: {yaw_deg: 45}\n"
    file = tmp_path / "turned.yaml"
    file.write_text(text, encoding="utf-8")
    start = load_scene(file).take_off
    assert (start.position_m, start.random, start.yaw_deg) == (None, False, 45.0)


def test_take_off_may_be_random_or_a_place(tmp_path: Path) -> None:
    """Both other forms of `from` are valid."""
    random = load_scene(written(tmp_path, GOOD.replace("helipad, yaw_deg: 30", "random")))
    assert random.take_off.random
    placed = load_scene(written(tmp_path, GOOD.replace("from: helipad", "from: [0.0, -0.5]")))
    assert placed.take_off.position_m == (0.0, -0.5)


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("boxes:", "boxs:", 3, "boxs: unknown key; did you mean 'boxes'? (known: lab, helipad,"),
        ("pattern: 1,", "patern: 1,", 4, "did you mean 'pattern'?"),
        ("pattern: 2", "pattern: 9", 5, "pattern must be 1 to 8, got 9"),
        ("pattern: 2", "pattern: 1.5", 5, "boxes[1].pattern: expected a whole number, got '1.5'"),
        ("pattern: 2, ", "", 5, "boxes[1]: lacks the key 'pattern'"),
        ("[1.4, 0.9]", "[2.4, 0.9]", 5, "outside the ground"),
        (
            "[-1.9, -1.4], yaw",
            "[-2.4, -1.4], yaw",
            2,
            "the landing mark at [-2.4, -1.4] stands",
        ),
        ("name: mine", "ground: {size_m: [6, 13]}", 1, "must be 2 to 12 m a side, got [6.0, 13.0]"),
        ("name: mine", "ground: {size_m: [3, 3]}", 2, "the ground ends at x = +-1.5, y = +-1.5"),
        ("[1.4, 0.9]", "[0.6, 0.9]", 5, "box-2 overlaps box-1"),
        ("[1.4, 0.9]", "[-1.7, -1.2]", 5, "overlaps the landing mark"),
        ("[1.4, 0.9]", "[1.4]", 5, "boxes[1].position_m: expected a list of 2, got a list of 1"),
        ("[1.4, 0.9]", "[1.4, yes]", 5, "boxes[1].position_m[1]: expected a number, got 'yes'"),
        ("[1.4, 0.9]", "[1.4, !!float x]", 5, "a number below 2**63, true or false, got 'x'"),
        ("[1.4, 0.9]", "[1.4, .nan]", 5, "expected a number, got '.nan'"),
        ("0.35, 0.8]", "0.35, 0.0]", 5, "at least 0.05 m"),
        ("ambient: 0.35", "ambient: 3", 6, "within 0 and 1, got 3.0"),
        ("-1.0], shadows", "1.0], shadows", 6, "downwards"),
        (
            "shadows: false",
            "shadows: maybe",
            6,
            "lighting.shadows: expected true or false, got 'maybe'",
        ),
        (
            "from: helipad",
            "from: heliport",
            7,
            "take_off.from: expected 'helipad' or 'random' or a list, got 'heliport'",
        ),
        ("from: helipad", "from: random", 7, "draws the yaw too"),
        ("from: helipad", "from: [4.0, 0.0]", 7, "outside the ground"),
        ("from: helipad", "from: [0.4, 0.7]", 7, "within 0.25 m of box-1"),
        ("name: mine", "name: [mine]", 1, "name: expected a text, got a list of 1"),
        ("name: mine", "name: mine\nname: yours", 2, "given twice"),
        ("name: mine", "name: {mine", 2, "not valid YAML"),
        (
            "name: mine",
            "name: !!python/name:os.system mine",
            1,
            "'mine' with the tag tag:yaml.org,2002:python/name:os",
        ),
    ],
)
def test_a_mistake_is_reported_with_its_line(
    tmp_path: Path, old: str, new: str, line: int, message: str
) -> None:
    """One message with file, line and mistake."""
    assert old in GOOD
    path = written(tmp_path, GOOD.replace(old, new))
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert caught.value.line == line
    assert str(caught.value).startswith(f"{path}:{line}: ")
    assert message in str(caught.value)


def _row(count: int) -> str:
    return "".join(
        f"  - {{pattern: {k % 8 + 1}, position_m: [{0.15 * k - 5:.2f}, 1.0], size_m: "
        "[0.1, 0.2, 1]}\n"
        for k in range(count)
    )


def test_a_pattern_may_be_used_more_than_once(tmp_path: Path) -> None:
    """A number after that of the pattern distinguishes boxes."""
    text = f"ground: {{size_m: [12, 4]}}\nhelipad: {{position_m: [0, -1]}}\nboxes:\n{_row(17)}"
    names = box_names(load_scene(written(tmp_path, text)).boxes)
    assert names[:9] == (*(f"box-{k}" for k in range(1, 9)), "box-1-2")
    assert names[16] == "box-1-3"
    assert len(set(names)) == 17


def test_too_many_boxes_are_refused_at_the_first_of_them(tmp_path: Path) -> None:
    """The class masks cannot distinguish more objects."""
    text = f"ground: {{size_m: [12, 4]}}\nhelipad: {{position_m: [0, -1]}}\nboxes:\n{_row(65)}"
    with pytest.raises(SceneError, match=r":68: boxes\[64\]: at most 64 boxes, got 65"):
        load_scene(written(tmp_path, text))


def test_a_ground_of_another_size_has_room_around_it(tmp_path: Path) -> None:
    """At least 2.5 m on each side; the room of the paper's carpet has 10 m."""
    paper = load_scene(written(tmp_path, GOOD))
    assert paper.ground.size_m == (5.0, 4.0)
    assert paper.room_size_m == (10.0, 10.0, 5.0)
    large = load_scene(written(tmp_path, GOOD + "ground: {size_m: [12, 6]}\n"))
    assert large.ground_plan.size_m == (12.0, 6.0)
    assert large.room_size_m == (17.0, 11.0, 5.0)


@pytest.mark.parametrize("name", ["place-6m", "place-8m", "hall-10m"])
def test_the_places_of_other_sizes_load(name: str) -> None:
    scene = load_scene(SCENES / f"{name}.yaml")
    assert scene.name == name
    side = float(name.rpartition("-")[2].removesuffix("m"))
    assert scene.ground.size_m == (side, side)


def test_the_place_with_movers_loads() -> None:
    scene = load_scene(SCENES / "moving.yaml")
    assert [mover.shape for mover in scene.movers] == ["cylinder", "box"]


def test_unknown_and_empty_scenes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'val-a'"):
        load_scene("vall-a")
    with pytest.raises(SceneError, match="has no landing mark to take off from"):
        load_scene(written(tmp_path, "# nothing\n"))


def test_the_ground_plan_names_the_classes_of_boxes_and_none_of_the_helipad() -> None:
    scene = load_scene("train-a")
    classes = [each.class_id for each in scene.ground_plan.standing]
    assert classes == [*(BOXES[box.pattern - 1] for box in scene.boxes), None]


# --- without a helipad ----------------------------------------------------------------------------

OPEN = """\
take_off: {from: [-1.5, 0.5], yaw_deg: 30}
boxes:
  - {pattern: 2, position_m: [1.0, -1.0], size_m: [0.4, 0.4, 1.0]}
"""


def test_a_scene_without_a_helipad_takes_off_from_its_place(tmp_path: Path) -> None:
    scene = load_scene(written(tmp_path, OPEN))
    assert (scene.helipad, scene.mark, scene.start_m) == (None, None, (-1.5, 0.5))
    pose = start_pose(scene, seed=3)
    assert (pose.x_m, pose.y_m, scene.surface_m(pose.x_m, pose.y_m)) == (-1.5, 0.5, 0.0)
    assert len(scene.ground_plan.standing) == 1
    again = tmp_path / "again.yaml"
    again.write_text(scene_text(scene), encoding="utf-8")
    assert load_scene(again) == scene


def test_a_scene_without_a_helipad_is_varied_and_looked_at(tmp_path: Path) -> None:
    scene = varied(load_scene(written(tmp_path, OPEN)), seed=1, room=True, movers=2)
    assert len(scene.movers) == 2
    assert all(mover.distance_m(*scene.start_m) >= 0.9 for mover in scene.movers)
    poses = sample_flight_poses(scene, np.random.default_rng(0), 14)
    assert all(pose.pitch_rad > -0.9 for pose in poses), "no pose looks down at a helipad"


def test_a_random_take_off_needs_no_helipad(tmp_path: Path) -> None:
    scene = load_scene(written(tmp_path, "take_off: {from: random}"))
    assert start_pose(scene, seed=1) != start_pose(scene, seed=2)
    with pytest.raises(SceneError, match="to take off from: give take_off a place"):
        load_scene(written(tmp_path, "take_off: {from: helipad}"))


def test_a_scene_in_python_has_ground_as_well() -> None:
    with pytest.raises(ValueRangeError, match="scene 'none' has no ground: expected a GroundSpec"):
        Scene(name="none", ground=None)  # type: ignore[arg-type]
