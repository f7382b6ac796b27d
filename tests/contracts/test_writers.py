"""On a full disk each writer ends with one error that names the file, and keeps no part of it."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
import pytest

from perception.camera.calibration import LayoutTrial
from perception.camera.camera_file import write_camera
from perception.depth.training.labelling import write_labels
from perception.networks.weights_file import SHIPPED_WEIGHTS, write_weights
from perception.segmentation.training.picks import Pick, write_picks
from tests.contracts.intact_files import write_views
from tests.paper_lab import CLASSES
from tests.uav_bt.campaign.campaign_world import jsonl, line
from tests.uav_bt.learning.frames_world import walk, write_video
from tests.uav_bt.learning.lab_world import draw_lab, write_colour_network
from tests.worlds.cli import HOP, all_commands, run, tree_file
from tests.worlds.processes import FULL_BYTES, full_disk
from uav_bt import app
from uav_bt.cli.declare import Command
from uav_bt.errors import FileError
from uav_bt.testing import pinhole

TRIAL: Final = LayoutTrial(8, 5, ("a.png",), 0.2, 0.2, pinhole(64, 36), 0.1)
PICK: Final = Pick(image="a.png", x=3, y=4, class_id=1)
LOST: Final = r"cannot be written|could not be written|was lost|ends early"
CALLS: Final = {
    "new new.xml": "new.xml",
    "tree render mission.xml --out new.svg": "new.svg",
    "tree schema --out new.xsd": "new.xsd",
    "fly mission.xml --drone plain --record new.mcap": "new.mcap",
    "fly mission.xml --drone plain --report new.json": "new.json",
    "fly mission.xml --drone plain --out new": "new/report.json",
    "fly mission.xml --drone plain --btlog new.btlog": "new.btlog",
    "fly mission.xml --image-size 64x36 --video new.mp4": "new.mp4",
    "view old.mcap --save new.rrd": "new.rrd",
    "campaign mission.xml --drone plain --flights 1 --scenes val-a --out new": "new/campaign.json",
    "report flights.jsonl --out new.html": "new",  # its figures come first
    "shrink failed.jsonl --out new": "scene.yaml",
    "net collect advised.xml --flights 3 --scene val-a --out new": "new",
    "net perceive photos --model contact --out new.mp4": "new.mp4",
    "net perceive photos --model contact --json new.jsonl": "new.jsonl",
    "net perceive photos --model contact --masks new": "new/a.png",
    "net evaluate depth --model contact --scene train-a --views 1 --out new.json": "new.json",
    "lab new new --in .": "new/lab.yaml",
    "lab schema --out new.json": "new.json",
    "lab scenes --show train-a --out new.png": "new.png",
    "lab print-mark paper --out new.pdf": "new.pdf",
    "lab frames hall walk.mp4 --count 2": "hall/frames",
    "lab train hall --steps 1 --batch 2": "hall/training",
    "lab check hall --out new.json": "hall/training/check.png",
}
"""Calls of commands that write, and the file that each of them names."""

STREAMS: Final = {"new.btlog", "new.jsonl"}
"""Files that grow while a flight or a video goes on: what they have is kept, and said to end."""

NOT_CALLED: Final = {
    "lab calibrate": "a file of a camera is written whole, as that of a lab",
    "lab film": "its videos are written as the film of a flight",
    "lab tune-heading": "its figure is one of `WRITERS`",
    "net evaluate student": "writes as `net evaluate depth`",
    "net export depth": "its file is one of `WRITERS`",
    "net export student": "its file is one of `WRITERS`",
    "net train depth": "its files are among `WRITERS`",
    "net train student": "its files are among `WRITERS`",
}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the calls read."""
    folder = tmp_path_factory.mktemp("inputs")
    mission = tree_file(folder, HOP)
    tree_file(folder, f'<Sequence><Advise policy="segmentation"/>{HOP}</Sequence>', "advised.xml")
    app.fly(mission, app.FlightOptions(drone="plain", record=folder / "old.mcap"))
    jsonl(folder / "flights.jsonl", line(0), line(1))
    failed: dict[str, Any] = {
        "tree": "land_only",
        "scene": "val-a",
        "seed": 3,
        "drone": "plain",
        "profile": "lab",
    }
    faults = ["battery-low=0.06@land"]
    jsonl(folder / "failed.jsonl", line(outcome="aborted", **failed, faults=faults))
    (folder / "photos").mkdir()
    cv2.imwrite(str(folder / "photos/a.png"), np.full((36, 64, 3), 90, np.uint8))
    write_video(folder / "walk.mp4", walk(4))
    write_colour_network(draw_lab(folder / "hall").network)
    return folder


def files(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and path.stat().st_size
    }


@pytest.mark.parametrize("call", CALLS)
def test_a_command_on_a_full_disk_names_the_file_and_keeps_no_part_of_it(
    call: str, inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    before = files(tmp_path)
    with full_disk():
        result = run(*call.split())
    error = result.stderr[result.stderr.rindex("Error: ") :]
    assert result.exit_code in {1, 2}, result.output
    assert re.search(LOST, error), error
    assert CALLS[call] in error
    assert "unexpected" not in result.stderr
    after = files(tmp_path)
    assert {name: after[name] for name in before} == before
    assert after.keys() - before.keys() <= STREAMS


def test_every_command_that_writes_is_called() -> None:
    writing = {
        " ".join(words)
        for words, command in all_commands()
        for param in command.params
        if isinstance(command, Command)
        and command.about[str(param.name)].path in {"written", "folder"}
    }
    called = {name for name in writing if any(f"{call} ".startswith(f"{name} ") for call in CALLS)}
    assert writing - called == NOT_CALLED.keys()


def write_figure(path: Path) -> None:
    from uav_bt.app import heading_tuning as tuning

    turn = np.linspace([0.0, 0.4, 0.0], [1.0, 0.4, 0.3], 20).T
    response = tuning.YawResponse(delay_s=0.1, lag_s=0.1, gain=1.0)
    tuning.draw([turn], response, {"shipped": tuning.suggested_loop(response, 0.1)}, path)


def write_network(path: Path) -> None:
    from perception.control.training.network import STUDENT_FILES

    STUDENT_FILES.export(SHIPPED_WEIGHTS / "student.safetensors", path)


WRITERS: Final[dict[str, Callable[[Path], object]]] = {
    "heading figure": write_figure,
    "network": write_network,
    "labels": lambda path: write_labels(path, np.ones((2, 2, 4, 6), np.float16)),
    "views": write_views,
    "weights": lambda path: write_weights(path, {"a": np.zeros(99)}, kind="a", details={}),
    "picks": lambda path: write_picks(path, [PICK] * 9, CLASSES),
    "camera": lambda path: write_camera(path, TRIAL),
}
"""Writers of further files, and of those whose commands take long."""


@pytest.mark.parametrize("kind", WRITERS)
def test_a_file_is_written_whole_or_stays_as_it_was(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "new.file"
    path.write_bytes(b"old")
    with full_disk(), pytest.raises(FileError, match=rf"new\.file.*({LOST})"):
        WRITERS[kind](path)
    assert [one.read_bytes() for one in tmp_path.iterdir()] == [b"old"]
    WRITERS[kind](path)
    assert len(path.read_bytes()) > FULL_BYTES
