"""`uav-bt lab`: scenes, camera files, new labs, their schema, images and picks."""

from __future__ import annotations

import json
import shutil
import socket
from http.server import HTTPServer
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from perception.camera.camera_file import load_camera
from sim_bridge.twin.scene_file import shipped_scenes
from tests.perception.camera.test_calibration import SIZE, TRUE, photograph
from tests.uav_bt.learning.frames_world import view, walk, write_video
from tests.worlds.cli import HOP, assert_refused, run, tree_file
from tests.worlds.labs import HALL, MARK, lab_folder
from uav_bt.lab.lab_file import lab_schema, read_lab
from uav_bt.lab.shipped import write_lab


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    """Return a folder with pictures of five boards, and one without a board."""
    folder = tmp_path / "pictures"
    folder.mkdir()
    turns = [(0.5, 0, 0), (-0.5, 0.2, 0.1), (0.1, 0.5, 0), (0, -0.5, 0.1), (0.4, 0.4, -0.1)]
    for index, turn in enumerate(turns):
        cv2.imwrite(str(folder / f"board{index}.png"), photograph(turn, (0.0, 0.0, 1.1)))
    cv2.imwrite(str(folder / "nothing.png"), np.full((540, 960), 99, dtype=np.uint8))
    return folder


def test_a_folder_of_pictures_becomes_a_camera_file(pictures: Path, tmp_path: Path) -> None:
    """Pictures count as they are stored, however a phone was held."""
    out, broken = tmp_path / "camera.yaml", pictures / "broken.jpg"
    broken.write_text("no picture", encoding="utf-8")
    turned = pictures / "board0.png"
    exif = Image.Exif()
    exif[0x0112] = 6  # a viewer rotates it by 90 degrees
    Image.open(turned).save(turned.with_suffix(".jpg"), quality=98, exif=exif)
    turned.unlink()
    for name in ("IMG_0001.HEIC", "IMG_0002.HEIC", "raw.dng"):
        (pictures / name).write_bytes(b"\0\0\0\x18ftypheic")
    result = run("lab", "calibrate", pictures, "--square-mm", 20, "--out", out)
    assert result.exit_code == 0, result.output
    camera = load_camera(out)
    assert (camera.width_px, camera.height_px) == SIZE
    assert camera.fx_px == pytest.approx(TRUE.fx_px, rel=0.02)
    assert ["24x13", "5"] in [line.split()[:2] for line in result.stdout.splitlines()]
    for words in (
        "<- kept",
        f"skipped {pictures / 'nothing.png'}: no board found",
        f"skipped {broken}",
        "3 of a format that is not read (dng, heic): IMG_0001.HEIC",
        "magick mogrify -format png",
        f"camera file: {out}",
    ):
        assert words in result.stdout
    assert "warning: corners were seen in" in result.stderr


# --- scenes ---------------------------------------------------------------------------------------


def test_scenes_has_a_line_for_each() -> None:
    result = run("lab", "scenes")
    assert result.exit_code == 0
    assert [line.split()[0] for line in result.stdout.splitlines()] == list(shipped_scenes())
    assert "0.60 to 2.15 m high (5 reach 1.5 m), landing mark at (-1.6, 1.2)" in result.stdout
    assert "take-off from the landing mark, yaw -20 deg" in result.stdout


@pytest.mark.parametrize(
    ("scene", "summary", "head", "count", "row"),
    [
        (
            "depot-train-a",
            "14 objects, 0.50 to 2.00 m high (5 reach 1.5 m)",
            "object class x,",
            14,
            "table-1 table 0.40 -1.70 15.0 1.20 x 0.70 0.75",
        ),
        ("train-a", "8 boxes", "object class x,", 8, "box-4 box_4 -1.50 1.10 5.0 0.50 x 0.40 0.80"),
    ],
)
def test_a_scene_is_drawn_and_what_stands_in_it_is_listed(
    tmp_path: Path, *, scene: str, summary: str, head: str, count: int, row: str
) -> None:
    out = tmp_path / "map.png"
    result = run("lab", "scenes", "--show", scene, "--out", out)
    assert summary in result.stdout
    header, *rows, last = [line.split() for line in result.stdout.splitlines()[1:]]
    assert (header[:3], len(rows), rows[3]) == (head.split(), count, row.split())
    assert last == ["map:", str(out)]
    assert cv2.imread(str(out)).std() > 10.0


def test_a_scene_without_boxes_has_no_table(tmp_path: Path) -> None:
    scene = tmp_path / "bare.yaml"
    scene.write_text("helipad: {position_m: [0, 0]}\n", encoding="utf-8")
    result = run("lab", "scenes", "--show", scene, "--out", tmp_path / "map.png")
    assert result.exit_code == 0, result.output
    assert len(result.stdout.splitlines()) == 2


VISIT = """<root BTCPP_format="4"><BehaviorTree ID="M"><ReactiveSequence>
<Rules area="start:-1,-2;start:2,-2;start:2,2;start:-1,2"/><SubTree ID="Perceive"/><Sequence>
<TakeOff/><GoTo to="start:0.5,0"/><GoTo to="lab:0.51,0"/><Face at="lab:1,0"/>
<GoTo to="object:3"/><GoTo to="mark"/>
<LoopString queue="file:rounds.csv" value="{p}"><GoTo to="{p}"/></LoopString><Land/>
</Sequence></ReactiveSequence></BehaviorTree></root>"""


@pytest.fixture
def empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_places_of_a_mission_have_their_room(empty: Path) -> None:
    """The box reaches from x = 0.8 to 1.2; start: counts from the mark, upwards."""
    box = "boxes: [{pattern: 2, position_m: [1, 0], size_m: [0.4, 0.4, 1.7]}]"
    scene = f"helipad: {{position_m: [-1, -1]}}\n{box}\ntake_off: {{yaw_deg: 90}}\n"
    Path("one.yaml").write_text(scene, encoding="utf-8")
    Path("rounds.csv").write_text("frame,x,y\nstart,1,1\nstart,1,3.2\nlab,0,1.8\n")
    Path("mission.xml").write_text(VISIT, encoding="utf-8")
    shown = ("lab", "scenes", "--show", "one.yaml", "--tree", "mission.xml")
    result = run(*shown)
    assert result.exit_code == 1, result.output
    rows = [" ".join(line.split()) for line in result.stdout.splitlines()[4:-1]]
    assert rows == [
        "start:0.5,0 -1.00 -0.50 1.50 m to the edge of the ground, 0.30 m needed",
        "lab:0.51,0 0.51 0.00 BAD: 0.29 m to box-2, 0.34 m needed",
        "lab:1,0 1.00 0.00 only faced",
        "object:3 known in flight only",
        "mark -1.00 -1.00 1.00 m to the edge of the ground, 0.20 m needed",
        "start:1,1 0.00 0.00 0.80 m to box-2, 0.34 m needed",
        "start:1,3.2 2.20 0.00 BAD: 1.20 m beyond the border of the area",
        "lab:0,1.8 0.00 1.80 BAD: 0.80 m beyond the border of the area",
    ]
    faults = result.stderr.splitlines()
    cure = "no room at 'lab:0.51,0', 0.29 m to box-2, 0.34 m needed: move it by 0.05 m"
    assert faults[0] == f"mission.xml:3:41: {cure}"
    assert f"{empty / 'rounds.csv'}:3: no room at 'start:1,3.2'" in faults[1]
    Path("mission.xml").write_text(VISIT.replace("lab:0.51", "lab:0.36"), encoding="utf-8")
    Path("rounds.csv").write_text("frame,x,y\nstart,1,1\n")
    assert run(*shown).exit_code == 0
    assert_refused(run("lab", "scenes", "--tree", "mission.xml"), "--tree needs --show SCENE")


def test_scenes_of_own_labs_are_found_by_name(empty: Path) -> None:
    lab_folder(empty / "labs" / "hall", HALL, scenes=("hall-a", "both"))
    office = lab_folder(empty / "labs" / "office", HALL, scenes=("office-a", "both"))
    listed = [line.split()[0] for line in run("lab", "scenes").stdout.splitlines()]
    assert listed == [*shipped_scenes(), "both", "hall-a", "office-a"]
    of_lab = run("lab", "scenes", "--lab", "hall").stdout.splitlines()
    assert [line.split()[0] for line in of_lab] == ["both", "hall-a"]
    assert run("lab", "scenes", "--show", "office-a").exit_code == 0
    assert run("lab", "scenes", "--show", "both", "--lab", "office").exit_code == 0
    several = "give --lab, or a path (labs/hall/scenes/both.yaml, labs/office/scenes/both.yaml)"
    assert_refused(run("lab", "scenes", "--show", "both"), several)
    looked = f"those in {empty}/labs/*/scenes: both, depot-test-a"
    for command in (("lab", "scenes", "--show"), ("fly", "land_only", "--scene")):
        unknown = run(*command, "ofice-a")
        assert_refused(unknown, "unknown scene 'ofice-a'; did you mean 'office-a'?", looked)
    file = office / "scenes" / "office-a.yaml"
    file.write_text(f"# copied\nlab: paper\n{file.read_text()}", encoding="utf-8")
    stated = "office-a.yaml:2: the scene is for the lab 'paper': remove this key, or write lab: off"
    assert stated in run("lab", "scenes", "--lab", "office").stdout
    assert_refused(run("fly", "land_only", "--lab", "office", "--scene", "office-a"), stated)


# --- labs -----------------------------------------------------------------------------------------


@pytest.fixture
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A mission, a script, and a lab with a ceiling of 0.9 m."""
    monkeypatch.chdir(tmp_path)
    tree_file(tmp_path, HOP)
    (tmp_path / "script.yaml").write_text("default: S\n")
    lab_folder(tmp_path / "labs" / "low", f"{HALL}{MARK}limits: {{ceiling_m: 0.9}}\n")
    return tmp_path


@pytest.mark.usefixtures("world")
def test_a_mission_fits_a_lab_or_is_refused() -> None:
    assert run("check", "mission.xml", "--lab", "paper").stdout == "mission.xml: good\n"
    lower = run("check", "mission.xml", "--lab", "low", "--set", "TakeOff.height_m=0.8")
    assert lower.stdout == "mission.xml: good\n"
    assert_refused(run("check", "mission.xml", "--lab", "low"), "above the ceiling of 0.9 m")
    found = json.loads(run("check", "mission.xml", "--lab", "low", "--format", "json").stdout)
    assert "above the ceiling" in found["findings"][0]["message"]
    simulated = run("simulate", "mission.xml", "--script", "script.yaml", "--lab", "low")
    assert_refused(simulated, "above the ceiling of 0.9 m")
    simulated = run("simulate", "mission.xml", "--script", "script.yaml", "--lab", "paper")
    assert simulated.exit_code == 0


def test_the_schema_is_printed_or_written(world: Path) -> None:
    assert run("lab", "schema").stdout == lab_schema()
    written = run("lab", "schema", "--out", "lab.schema.json")
    assert written.stdout == "written: lab.schema.json\n"
    assert (world / "lab.schema.json").read_text() == lab_schema()


def test_a_new_lab_can_be_flown_at_once(world: Path) -> None:
    result = run("lab", "new", "hall")
    assert result.stdout.startswith("written: labs/hall/lab.yaml")
    lab = read_lab(world / "labs" / "hall")
    assert lab.mark is not None
    assert lab.mark.kind == "apriltag"
    assert run("check", "mission.xml", "--lab", "hall").stdout == "mission.xml: good\n"
    simulated = run("lab", "new", "office", "--simulated")
    assert "fly survey_and_land --drone plain --lab labs/office" in simulated.stdout
    flown = run("fly", "mission.xml", "--lab", "office", "--drone", "plain", "--scene", "office-a")
    assert flown.exit_code == 0, flown.output


# --- images of a lab from videos, and picks on them -----------------------------------------------

PICKS = """\
image,x,y,class,origin
0.png,1,1,floor,hand
0.png,2,2,floor,hand
1.png,3,3,pad,hand
"""


@pytest.fixture
def hall(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A lab with five images, of which the last is for the check; serving ends at once."""
    monkeypatch.chdir(tmp_path)
    folder = write_lab("hall", Path("labs")).parent
    (folder / "frames").mkdir()
    for number in range(5):
        cv2.imwrite(str(folder / "frames" / f"{number}.png"), np.zeros((9, 16, 3), dtype=np.uint8))

    def stopped(_: HTTPServer) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(HTTPServer, "serve_forever", stopped)
    return folder


def test_without_picks_it_counts_none_of_each_class_and_names_the_next_command(hall: Path) -> None:
    result = run("lab", "pick", "hall")
    assert result.exit_code == 0, result.output
    assert "open http://127.0.0.1:" in result.stdout
    none = "outside 0, floor 0, pad 0, obstacle 0"
    assert f"0 picks: {hall / 'picks.csv'} ({none})\n" in result.stdout
    assert "images with picks: 0 for training, 0 for the check" in result.stdout
    assert result.stdout.endswith("next: uav-bt lab train hall\n")
    assert not (hall / "picks.csv").exists()


def test_it_sums_up_the_picks(hall: Path) -> None:
    (hall / "picks.csv").write_text(PICKS, encoding="utf-8")
    result = run("lab", "pick", hall)
    assert (
        f"3 picks: {hall / 'picks.csv'} (outside 0, floor 2, pad 1, obstacle 0)\n" in result.stdout
    )
    assert "images with picks: 2 for training, 0 for the check" in result.stdout
    (hall / "picks.csv").write_text(PICKS.replace("1.png", "4.png"), encoding="utf-8")
    result = run("lab", "pick", hall)
    assert "images with picks: 1 for training, 1 for the check" in result.stdout


def test_a_port_that_is_taken_is_refused(hall: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        refused = run("lab", "pick", "hall", "--port", port)
    assert_refused(refused, f"port {port} cannot be served", "give another --port")


def test_the_summary_counts_images_by_source(hall: Path) -> None:
    shutil.rmtree(hall / "frames")
    write_video(Path("walk.mp4"), walk(10))
    result = run("lab", "frames", "hall", "walk.mp4", "--count", 8)
    assert result.exit_code == 0, result.output
    heading, line, last = result.stdout.splitlines()
    assert heading.split()[:2] == ["source", "read"]
    assert line.split() == ["walk.mp4", "10", "0", "0", "2", "8", "2"]
    assert last == "images: 8 in labs/hall/frames"
    assert "Warning: 8 images are few for a network, 40 are the least" in result.stderr
    assert len(list((hall / "frames").glob("*.jpg"))) == 8
    again = run("lab", "frames", "hall", "walk.mp4")
    assert "taken in an earlier run" in again.stdout
    assert "images: 8" in again.stdout


def test_a_source_without_images_is_refused_after_the_others(hall: Path) -> None:
    shutil.rmtree(hall / "frames")
    write_video(Path("walk.mp4"), walk(4))
    write_video(Path("still.mp4"), [view(0)] * 4)
    result = run("lab", "frames", hall, "still.mp4", "walk.mp4")
    assert result.exit_code == 2
    assert "images: 4" in result.stdout
    assert "Error: still.mp4: all its images look alike" in result.stderr
    assert_refused(run("lab", "frames", hall, "still.mp4"), "still.mp4: all its images look alike")
