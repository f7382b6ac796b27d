"""`--lab` of check and simulate, `uav-bt lab new` and `lab schema`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.uav_bt.app.test_lab_flights import LAB, MARK
from tests.worlds.cli import HOP, assert_refused, run, tree_file
from uav_bt.lab.lab_file import lab_schema, read_lab


@pytest.fixture
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A mission, a script, and a lab with a ceiling of 0.9 m."""
    monkeypatch.chdir(tmp_path)
    tree_file(tmp_path, HOP)
    (tmp_path / "script.yaml").write_text("default: S\n")
    (tmp_path / "labs" / "low").mkdir(parents=True)
    (tmp_path / "labs" / "low" / "lab.yaml").write_text(f"{LAB}{MARK}limits: {{ceiling_m: 0.9}}\n")
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


def test_a_new_lab_changes_nothing_that_exists(world: Path) -> None:
    before = (world / "labs" / "low" / "lab.yaml").read_bytes()
    assert_refused(run("lab", "new", "low"), "labs/low: exists: choose another name")
    assert (world / "labs" / "low" / "lab.yaml").read_bytes() == before
    assert_refused(run("lab", "new", "paper"), "a lab 'paper' ships with uav-bt")
    assert_refused(run("lab", "new", "../hall"), "consists of small letters")
    (world / "file").touch()
    assert_refused(run("lab", "new", "hall", "--in", "file"), "cannot be written")
