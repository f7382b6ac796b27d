"""The wheel contains everything for a mission, and works without a checkout."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest

from tests.worlds.processes import ROOT, python

ROOMS = ("uav_bt", "labs", "perception", "sim_bridge", "behaviours", "trees")
FLY = """\
<root BTCPP_format="4"><BehaviorTree ID="Main"><ReactiveSequence>
  <Segment model="unet"/>
  <Sequence><TakeOff height_m="1.0"/><Land/></Sequence>
</ReactiveSequence></BehaviorTree></root>
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wheel from a copy of the sources, without network access."""
    copy, out = tmp_path_factory.mktemp("sources"), tmp_path_factory.mktemp("wheel")
    for room in ROOMS:
        shutil.copytree(
            ROOT / room, copy / room, ignore=shutil.ignore_patterns("__pycache__", "*.part")
        )
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    built = python(
        *("-m", "pip", "wheel", "--quiet", "--no-deps", "--no-index"),
        *("--no-build-isolation", "--wheel-dir", out, copy),
    )
    assert built.returncode == 0, built.stderr
    (path,) = out.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Unpack the wheel into a folder, like an installation."""
    folder = tmp_path_factory.mktemp("installed")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)
    return folder


def uav_bt(installed: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the installed package in a folder far from the checkout."""
    where = {"PYTHONPATH": str(installed)}
    return python("-m", "uav_bt", *arguments, folder=folder, environment=where)


def test_the_wheel_holds_trees_scenes_and_weights(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        held = set(archive.namelist())
    wanted = {
        path.relative_to(ROOT).as_posix()
        for room in (*ROOMS, "uav_bt/labs")  # a link, which rglob does not follow
        if room != "labs"
        for path in (ROOT / room).rglob("*")
        if not (room == "uav_bt/labs" and path.parts[-2] in ("frames", "training"))
        and path.suffix
        in {".py", ".xml", ".yaml", ".onnx", ".safetensors", ".typed", ".jpg", ".obj", ".html"}
    }
    assert {Path(name).name for name in wanted - held} == {
        "depth.safetensors",
        "student.safetensors",
    }
    assert not [name for name in held if name.startswith(("tests/", "benchmarks/", "tools/"))]


def test_missions_check_and_fly_far_from_the_checkout(installed: Path, tmp_path: Path) -> None:
    checked = uav_bt(installed, tmp_path, "check", "land_only")
    assert checked.returncode == 0, checked.stderr
    assert checked.stdout == f"{installed / 'trees' / 'land_only.xml'}: good\n"
    in_lab = uav_bt(installed, tmp_path, "check", "land_only", "--lab", "paper")
    assert in_lab.stdout == checked.stdout, in_lab.stderr
    assert (installed / "uav_bt" / "labs" / "lab.schema.json").is_file()
    (tmp_path / "mine.xml").write_text(FLY, encoding="utf-8")
    flown = uav_bt(installed, tmp_path, "fly", "mine.xml", "--image-size", "160x90")
    assert flown.returncode == 0, flown.stderr
    assert "success" in flown.stdout


def test_an_export_of_weights_that_the_wheel_leaves_out_says_where_they_are(
    installed: Path, tmp_path: Path
) -> None:
    done = uav_bt(installed, tmp_path, "net", "export", "depth")
    assert done.returncode == 2
    assert "work in a checkout of the repository" in done.stderr
    assert "Traceback" not in done.stderr
