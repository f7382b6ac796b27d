"""Outputs of every command: never an input's path, and checked before the work begins."""

from __future__ import annotations

import os
from pathlib import Path

import click
import pytest

from tests.worlds.cli import HOP, all_commands, assert_refused, run, tree_file
from uav_bt.cli.declare import Command

INCLUDING = '<root BTCPP_format="4"><include path="sub/parts.xml"/></root>'
SCENE = "helipad: {position_m: [0, 0]}\n"
SITE = "camera: camera.yaml\n"
LAB = """\
version: 1
classes:
  wall: {role: outside, colour: "#000000"}
  floor: {role: ground, colour: "#808080"}
camera: camera.yaml
"""


@pytest.fixture
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a small mission and all other inputs of commands."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()
    tree_file(tmp_path, HOP)
    tree_file(tmp_path / "sub", HOP, "parts.xml")
    (tmp_path / "including.xml").write_text(INCLUDING)
    (tmp_path / "named.xml").write_text('<x model="net.onnx" policy="student:pilot.onnx"/>')
    (tmp_path / "link.xml").symlink_to("mission.xml")
    os.link(tmp_path / "mission.xml", tmp_path / "hard.xml")
    (tmp_path / "scene.yaml").write_text(SCENE)
    (tmp_path / "site.yaml").write_text(SITE)
    (tmp_path / "labs" / "hall").mkdir(parents=True)
    (tmp_path / "labs" / "hall" / "lab.yaml").write_text(LAB)
    (tmp_path / "photos").mkdir()
    (tmp_path / "campaign").mkdir()
    for name in (
        "labs/hall/camera.yaml",
        *("camera.yaml", "script.yaml", "net.onnx", "pilot.onnx", "old.mcap"),
        *("flight.mp4", "w.safetensors", "flights.jsonl", "photos/board.png"),
        "campaign/campaign.json",
    ):
        (tmp_path / name).write_text(f"this is {name}")
    palette = '<root BTCPP_format="4"><TreeNodesModel/></root>'
    (tmp_path / "palette.xml").write_text(palette)
    return tmp_path


def contents(folder: Path) -> dict[str, bytes]:
    return {str(file): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.mark.parametrize(
    "line",
    [
        "fly mission.xml --report mission.xml",
        "fly mission.xml --report link.xml",
        "fly mission.xml --report hard.xml",
        "fly including.xml --report sub/parts.xml",
        "fly named.xml --report pilot.onnx",
        "fly mission.xml --lab labs/hall --report labs/hall/lab.yaml",
        "fly mission.xml --policy Explore=student:pilot.onnx --report pilot.onnx",
        "tree render mission.xml --out mission.xml",
        "tree render mission.xml --palette palette.xml --out palette.xml",
        "tree schema --palette palette.xml --out palette.xml",
        "net perceive flight.mp4 --out flight.mp4",
        "net perceive flight.mp4 --camera camera.yaml --json camera.yaml",
        "net perceive flight.mp4 --segmentation net.onnx --json net.onnx",
        "net perceive photos --json photos/board.png",
        "net perceive campaign --json campaign/campaign.json",
        "net train depth old.mcap --start w.safetensors --out w.safetensors",
        "lab check labs/hall --model net.onnx --out net.onnx",
        "net evaluate depth --model net.onnx --out net.onnx",
        "net evaluate student old.mcap --out old.mcap",
        "net export depth --weights net.onnx --out net.onnx",
        "lab calibrate photos --out photos/board.png",
    ],
)
def test_an_input_is_never_overwritten(line: str, world: Path) -> None:
    before = contents(world)
    assert_refused(run(*line.split()), "is an input and would be overwritten")
    assert contents(world) == before


def test_a_shipped_mission_is_an_input_when_it_is_named() -> None:
    shipped = Path(__file__).parents[3] / "trees" / "land_only.xml"
    before = shipped.read_bytes()
    assert_refused(
        run("fly", "land_only", "--report", shipped), "is an input and would be overwritten"
    )
    assert shipped.read_bytes() == before


OUTPUTS = [
    "fly mission.xml --out {}",
    "fly mission.xml --report {}.json",
    "fly mission.xml --record {}.mcap",
    "fly mission.xml --video {}.mp4",
    "fly mission.xml --btlog {}.btlog",
    "tree render mission.xml --out {}.svg",
    "tree schema --out {}.xsd",
    "view old.mcap --save {}.rrd",
    "report flights.jsonl --out {}.html",
    "campaign mission.xml --out {}",
    "shrink flights.jsonl --out {}",
    "net collect mission.xml --out {}",
    "net perceive flight.mp4 --out {}.mp4",
    "net perceive flight.mp4 --json {}.json",
    "net perceive flight.mp4 --masks {}",
    "net train depth old.mcap --out {}.safetensors",
    "net train depth old.mcap --run {}",
    "net train student old.mcap --out {}.safetensors",
    "net evaluate depth --out {}.json",
    "net evaluate student old.mcap --out {}.json",
    "net export depth --out {}.onnx",
    "net export student --out {}.onnx",
    "lab scenes --show train-a --out {}.png",
    "lab check labs/hall --out {}.json",
    "lab schema --out {}.json",
    "lab calibrate photos --out {}.yaml",
    "lab tune-heading old.mcap --out {}.png",
]


@pytest.mark.parametrize("line", OUTPUTS)
@pytest.mark.parametrize("place", ["/proc/x", "mission.xml/x"])
def test_where_nothing_can_be_written_is_found_before_the_work(
    line: str, place: str, world: Path
) -> None:
    before = contents(world)
    words = {"/proc/x": "cannot be written", "mission.xml/x": "is a file"}
    result = run(*line.format(place).split())
    assert result.exit_code == 2, result.output
    assert words[place] in result.stderr
    assert contents(world) == before


@pytest.mark.parametrize("line", [line for line in OUTPUTS if "." in line.split("{}")[-1]])
def test_a_folder_is_no_file(line: str, world: Path) -> None:
    suffix = line.rsplit("{}", maxsplit=1)[-1]
    (world / f"taken{suffix}").mkdir()
    assert_refused(run(*line.format("taken").split()), f"'taken{suffix}' is a directory")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("fly mission.xml --report x.mp4 --video ./x.mp4", "name the same file"),
        ("net perceive flight.mp4 --out x.mp4 --json x.mp4", "name the same file"),
        ("fly mission.xml --report /dev/null", "device"),
        ("fly mission.xml --report=", "is a folder; name a file"),
        ("shrink flights.jsonl --out .", "empty or a new folder"),
    ],
)
def test_what_is_no_file_of_its_own_is_refused(line: str, words: str, world: Path) -> None:
    before = contents(world)
    assert_refused(run(*line.split()), words)
    assert contents(world) == before
    assert Path("/dev/null").is_char_device()


def test_an_output_that_is_no_input_is_replaced(world: Path) -> None:
    (world / "tree.svg").write_text("old")
    result = run("tree", "render", "mission.xml", "--format", "svg", "--out", "tree.svg")
    assert result.exit_code == 0, result.output
    assert "<svg" in (world / "tree.svg").read_text()


def test_every_command_looks_at_its_outputs_and_each_is_in_the_table_above() -> None:
    seen = set()
    for words, command in all_commands():
        assert isinstance(command, Command), words
        for param in command.params:
            if command.about[str(param.name)].path in {"written", "folder"}:
                seen.add((" ".join(words), param.opts[0]))
            elif isinstance(param, click.Option) and isinstance(param.type, click.Path):
                assert "written" not in str(param.help).lower()
    tried = set()
    for line in OUTPUTS:
        head = line.split(" --")[0].split()
        for words, _ in all_commands():
            if head[: len(words)] == list(words):
                options = [word for word in line.split() if word.startswith("--")]
                tried |= {(" ".join(words), option) for option in options}
    assert seen - tried == {("campaign", "--resume"), ("net train student", "--run")}
