"""Films of a simulated lab: videos of each scene, and the way that the pilot flies."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import av
import numpy as np
import pytest

from sim_bridge.twin.scene_file import load_scene
from tests.worlds.cli import assert_refused, run
from tests.worlds.labs import HALL, MARK, lab_folder
from uav_bt.errors import InputError
from uav_bt.learning.lab_film import ROOM_M, FreeGround

LAB = f"""{HALL}{MARK}
room:
  ground: {{size_m: [5, 4], surface: {{colour: "#808080"}}}}
  walls: {{height_m: 2.6, beside_m: 0}}
  objects:
    screen: {{class: drum, shape: box, size_m: [0.1, 1.6, 1.7], surface: {{colour: "#a04040"}}}}
"""
DRUM = '    drum: {class: drum, shape: box, size_m: [0.5, 0.5, 0.9], surface: {colour: "#a04040"}'
SCENE = """\
helipad: {position_m: [1.2, 0.5]}
objects: [{kind: screen, position_m: [0, 0]}]
take_off: {from: [-1.2, -0.5]}
"""
MOVER = "movers: [{kind: drum, path_m: [[-0.8, 1.4], [0.8, 1.4]], speed_mps: 0.5}]\n"


def scene_file(lab: str, scene: str = SCENE) -> Path:
    file = lab_folder(Path("labs/hall"), lab) / "scenes/morning.yaml"
    file.write_text(scene, encoding="utf-8")
    return file


@pytest.mark.parametrize(
    ("ending", "films"), [(", moves: true}\n", ["-movers", ""]), ("}\n", [""])]
)
def test_each_scene_is_filmed_and_movers_in_a_second_flight(
    ending: str, films: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    scene_file(LAB + DRUM + ending)
    call = ("lab", "film", "hall", "--movers", 1, "--places", 1, "--image-size", "64x36")
    result = run(*call)
    assert result.exit_code == 0, result.output
    assert "Warning" not in result.stderr  # nothing was touched
    files = [Path(f"runs/hall-video/morning{each}.mp4") for each in films]
    assert sorted(Path("runs/hall-video").iterdir()) == files
    for file in files:
        with av.open(str(file)) as video:
            assert sum(1 for _ in video.decode(video=0)) > 250
    assert ("no kind of object of the lab 'hall' moves" in result.stdout) == (len(files) == 1)
    assert_refused(run(*call), "runs/hall-video: has files")


def test_the_way_leads_around_what_is_as_high_as_the_drone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    scene = load_scene(scene_file(f"{LAB}{DRUM}}}\n", SCENE + MOVER))
    for height_m, screen, drum in ((2.4, False, False), (1.5, True, False), (1.4, True, True)):
        ground = FreeGround(scene, height_m)
        begin = ground.cell_near(scene.start_m)
        way = list(ground.way(begin, ground.cell_near((1.2, 0.5), begin)))
        legs = [np.linspace(*ends, 50).tolist() for ends in pairwise(way)]
        away_m = min(scene.placed[0].footprint.distance_m(*at) for leg in legs for at in leg)
        assert (away_m > ROOM_M - 0.1) == screen
        near = ground.point(ground.cell_near((0.0, 1.4)))
        assert (scene.movers[0].distance_m(*near) > ROOM_M) == drum
    wide = LAB.replace("[0.1, 1.6, 1.7]", "[3, 3, 1.7]")
    bare = SCENE[SCENE.index("objects") :].replace("[-1.2, -0.5]", "[-2, 0]")
    with pytest.raises(InputError, match=r"'morning' has no room to film at 1\.5 m"):
        FreeGround(load_scene(scene_file(wide, bare)), 1.5)
