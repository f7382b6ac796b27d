"""Outputs of a flight in Python never overwrite its inputs."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from sim_bridge.twin import TwinConfig
from uav_bt import app
from uav_bt.errors import FileError

HOP = '<BehaviorTree ID="Hop"><Sequence><TakeOff/><Land/></Sequence></BehaviorTree>'
LOOK = '<BehaviorTree ID="Look"><Sequence><Explore/></Sequence></BehaviorTree>'
CAMERA = "image_size_px: [640, 360]\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, text in {
        "hop.xml": f'<root BTCPP_format="4">{HOP}</root>',
        "look.xml": f'<root BTCPP_format="4">{LOOK}</root>',
        "main.xml": '<root BTCPP_format="4" main_tree_to_execute="Hop"><include path="hop.xml"/>'
        "</root>",
        "scene.yaml": "helipad: {position_m: [0, 0]}\n",
        "camera.yaml": CAMERA,
        "site.yaml": "camera: camera.yaml\n",
        "pilot.onnx": "weights",
        "flight.mcap": "record",
    }.items():
        Path(name).write_text(text, encoding="utf-8")
    Path("link.json").symlink_to("hop.xml")
    return tmp_path


@pytest.mark.parametrize(
    ("tree", "options", "report"),
    [
        ("hop.xml", {}, "hop.xml"),
        (Path("hop.xml"), {}, "link.json"),
        ("main.xml", {}, "hop.xml"),
        ("hop.xml", {"scene": "scene.yaml"}, "scene.yaml"),
        ("hop.xml", {"drone": TwinConfig(scene="scene.yaml")}, "scene.yaml"),
        ("hop.xml", {"camera": "camera.yaml"}, "camera.yaml"),
        ("hop.xml", {"site": "site.yaml"}, "site.yaml"),
        ("hop.xml", {"site": "site.yaml"}, "camera.yaml"),
        ("look.xml", {"policies": {"Explore": "student:pilot.onnx"}}, "pilot.onnx"),
    ],
)
def test_no_report_overwrites_an_input(
    tree: str | Path, options: dict[str, Any], report: str, folder: Path
) -> None:
    before = {file: file.read_bytes() for file in folder.iterdir()}
    message = rf"^{report}: is an input and would be overwritten; choose another name"
    with pytest.raises(FileError, match=message):
        app.fly(tree, app.FlightOptions(**options), report=report)
    assert {file: file.read_bytes() for file in folder.iterdir()} == before


@pytest.mark.usefixtures("folder")
def test_the_files_of_a_loaded_tree_are_inputs() -> None:
    tree = app.check("main.xml")
    for name in ("main.xml", "hop.xml"):
        with pytest.raises(FileError, match=f"^{name}: is an input"):
            app.fly(tree, report=name)


@pytest.mark.usefixtures("folder")
def test_report_and_record_are_two_files() -> None:
    os.link("flight.mcap", "report.json")
    with pytest.raises(FileError, match=r"^report.json: .*for the report and for the record"):
        app.fly("hop.xml", app.FlightOptions(record="flight.mcap"), report="report.json")
