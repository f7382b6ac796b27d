"""Commands made of functions; refused calls: one message, exit code 2, and every file as before."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import click
import cv2
import numpy as np
import pytest
from annotated_types import Ge, Gt, Le
from click.testing import CliRunner

from tests.worlds.cli import HOP, all_commands, assert_refused, run, tree_file
from tests.worlds.tables import cases
from uav_bt.cli.declare import Command, command
from uav_bt.errors import InputError
from uav_bt.option import Option, pairs

SEEN: list[dict[str, Any]] = []
NONE: Mapping[str, str] = {}


def _values(texts: tuple[str, ...]) -> dict[str, str]:
    return pairs(texts, "name", "NAME=VALUE")


@dataclass(frozen=True, kw_only=True)
class Size:
    width: Annotated[int, Ge(1), Le(9), Option("Width.", "", "Size")] = 3
    height: Annotated[int, Option("For Python only.")] = 2


@command(sections=("Size",))
def example(
    name: str,
    files: Annotated[tuple[Path, ...], Option(form="[FILE]...")] = (),
    *,
    size: Annotated[Size, Option(parts=Size, only=("width",), defaults={"width": 4})],
    share: Annotated[float | None, Gt(0), Option("Share.", "--part SHARE")] = None,
    form: Literal["a", "b"] = "a",
    on: bool = True,
    values: Annotated[Mapping[str, str], Option("Values.", read=_values)] = NONE,
    where: Annotated[str | None, Option("Where.", "[WHERE]", alone="here")] = None,
) -> None:
    """Note what was given.

    Options:
        form: Form
            of letters.
        on: Whether it is on.
    """
    SEEN.append(locals())


@pytest.mark.parametrize(
    ("line", "given"),
    [
        ("x", {}),
        ("x f g --width 9", {"files": (Path("f"), Path("g")), "size": Size(width=9)}),
        ("x --part 0.5 --form b --no-on", {"share": 0.5, "form": "b", "on": False}),
        ("x --values a=1 --values b=2", {"values": {"a": "1", "b": "2"}}),
        ("x --where", {"where": "here"}),
        ("x --where there", {"where": "there"}),
    ],
)
def test_a_function_gets_what_the_command_line_says(line: str, given: dict[str, Any]) -> None:
    assert CliRunner().invoke(example, line.split()).exit_code == 0
    defaults = {"name": "x", "files": (), "size": Size(width=4), "share": None}
    defaults |= {"form": "a", "on": True, "values": {}, "where": None}
    assert SEEN.pop() == {**defaults, **given}


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("", "Missing argument 'NAME'"),
        ("x --width 0", "'--width': 0 is not in the range 1<=x<=9"),
        ("x --part 0", "'--part': 0.0 is not in the range x>0"),
        ("x --width 1.5", "'--width': '1.5' is not a valid integer"),
        ("x --part half", "'--part': 'half' is not a valid number"),
        ("x --part nan", "'--part': 'nan' is not a finite number"),
        ("x --form c", "'c' is not one of 'a', 'b'"),
        ("x --height 3", "No such option '--height'"),
        ("x --values a", "'--values': expected NAME=VALUE, got 'a'"),
    ],
)
def test_what_it_does_not_take_is_refused(line: str, words: str) -> None:
    result = CliRunner().invoke(example, line.split())
    assert (result.exit_code, words in result.stderr) == (2, True), result.stderr


def test_the_help_has_sections_and_then_the_other_options() -> None:
    lines = CliRunner().invoke(example, ["--help"]).stdout.splitlines()
    assert [line for line in lines if line.endswith(":")] == ["Size:", "Options:"]
    assert lines[lines.index("Size:") + 1].split()[:3] == ["--width", "INTEGER", "Width."]
    assert [line.split()[2:] for line in lines if "--form" in line] == [["Form", "of", "letters."]]


def test_pairs_have_a_name_and_one_value() -> None:
    assert pairs(["a=b=c"], "name", "") == {"a": "b=c"}
    assert pairs(["a=b=c"], "name", "", last=True) == {"a=b": "c"}
    for texts, words in ((["=c"], "expected NAME=VALUE, got '=c'"), (["a=1", "a=2"], "two values")):
        with pytest.raises(InputError, match=words):
            pairs(texts, "name", "NAME=VALUE")


# --- refused calls --------------------------------------------------------------------------------

CASES = cases("refusals")
REFUSED = {line: words for part in CASES["refused"].values() for line, words in part.items()}
OUTPUTS = [
    (command, option, place)
    for command, options in CASES["written"].items()
    for option, place in re.findall(r"(--\S+) (\S+)", options)
]
TREES = {
    "mission.xml": HOP,
    "sub/parts.xml": HOP,
    "unknown.xml": "<Sequence><TakeOff/><Lnd/></Sequence>",
    "laps.xml": '<Sequence><TakeOff/><Repeat num_cycles="{laps}"><HoverFor/></Repeat><Land/>'
    "</Sequence>",
}
JUNK = b"\x7fELF" + bytes(range(255, -1, -1)) * 40
FILES = {
    "including.xml": '<root BTCPP_format="4"><include path="sub/parts.xml"/></root>',
    "named.xml": '<x model="net.onnx" policy="student:pilot.onnx"/>',
    "unclosed.xml": '<root BTCPP_format="4">\n<BehaviorTree ID="x"',
    "palette.xml": '<root BTCPP_format="4"><TreeNodesModel/></root>',
    "scene.yaml": "helipad: {position_m: [0, 0]}\n",
    "site.yaml": "camera: camera.yaml\n",
    "broken.yaml": "boxes: [",
    "keys.yaml": "flight_hight_m: 1.2\n",
    "margins.yaml": "margins: {obstacle_m: 0.25}\n",
    "script.yaml": "default: S\n",
    "variants.yaml": "variants: {one: {var: {laps: 2}},\n two: {var: {laps: x}}}",
    "labs/hall/lab.yaml": """\
version: 1
classes:
  wall: {role: outside, colour: "#000000"}
  floor: {role: ground, colour: "#808080"}
camera: camera.yaml
""",
    **dict.fromkeys(("empty.xml", "empty.yaml", "empty.jsonl", "empty.mcap"), ""),
    **dict.fromkeys(("camera.yaml", "labs/hall/camera.yaml", "net.onnx", "pilot.onnx"), "other"),
    **dict.fromkeys(("flight.mp4", "old.mcap", "flights.jsonl", "w.safetensors"), "other"),
    **dict.fromkeys(("photos/board.png", "campaign/campaign.json"), "other"),
    **dict.fromkeys(("binary.bin", "binary.xml", "record.mcap"), JUNK),
    "weights.safetensors": b"\x02\0\0\0\0\0\0\0{}",
}


@pytest.fixture
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with good and bad files of all kinds."""
    monkeypatch.chdir(tmp_path)
    for folder in ("sub", "photos", "empty", "campaign", "labs/hall"):
        Path(folder).mkdir(parents=True)
    for name, body in TREES.items():
        tree_file(tmp_path, body, name)
    for name, content in FILES.items():
        Path(name).write_bytes(content if isinstance(content, bytes) else content.encode())
    cv2.imwrite("photos/a.png", np.full((36, 64, 3), 90, dtype=np.uint8))
    Path("link.xml").symlink_to("mission.xml")
    os.link("mission.xml", "hard.xml")
    return tmp_path


def contents(folder: Path) -> dict[Path, bytes | None]:
    return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


def assert_changes_nothing(line: str, words: str, folder: Path) -> None:
    """Assert that a call is refused with a message of this pattern, and changes no file."""
    before = contents(folder)
    result = run(*line.split())
    assert result.exit_code == 2, result.output
    assert result.stdout == "" or line.startswith("doctor")
    assert "Traceback" not in result.stderr
    assert "unexpected" not in result.stderr.replace("unexpected extra", "")
    assert re.search(words, re.sub(r"\s*\n\s*", " ", result.stderr)), result.stderr
    assert contents(folder) == before
    assert Path("/dev/null").is_char_device()


@pytest.mark.parametrize("line", REFUSED)
def test_a_wrong_call_is_answered_and_changes_no_file(line: str, world: Path) -> None:
    assert_changes_nothing(line, REFUSED[line], world)


@pytest.mark.parametrize(("command", "option", "path"), OUTPUTS)
def test_outputs_are_checked_before_work(command: str, option: str, path: str, world: Path) -> None:
    for place, words in (("/proc/x", "cannot be written"), ("mission.xml/x", "is a file")):
        assert_changes_nothing(f"{command} {option} {path.format(place)}", words, world)
    if "." in path:
        taken = path.format("taken")
        (world / taken).mkdir()
        words = f"'{taken}' is a directory"
        assert_changes_nothing(f"{command} {option} {taken}", words, world)


def test_an_output_that_is_no_input_is_replaced(world: Path) -> None:
    (world / "tree.svg").write_text("old")
    result = run("tree", "render", "mission.xml", "--format", "svg", "--out", "tree.svg")
    assert result.exit_code == 0, result.output
    assert "<svg" in (world / "tree.svg").read_text()


def test_a_shipped_mission_is_an_input_when_it_is_named() -> None:
    shipped = Path(__file__).parents[3] / "trees" / "land_only.xml"
    before = shipped.read_bytes()
    assert_refused(run("fly", "land_only", "--report", shipped), "is an input and would be over")
    assert shipped.read_bytes() == before


def test_every_output_of_every_command_is_in_the_table() -> None:
    seen, tried = set(), set()
    for words, each in all_commands():
        assert isinstance(each, Command), words
        head = " ".join(words)
        tried |= {
            (head, option) for line, option, _ in OUTPUTS if f"{line} ".startswith(f"{head} ")
        }
        for param in each.params:
            if each.about[str(param.name)].path in {"written", "folder"}:
                seen.add((head, param.opts[0]))
            elif isinstance(param, click.Option) and isinstance(param.type, click.Path):
                assert "written" not in str(param.help).lower()
    assert seen - tried == {("campaign", "--resume"), ("net train student", "--run")}
