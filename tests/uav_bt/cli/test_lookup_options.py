"""`--trees`, `--include-root`, `--ros-pkg`: a mission of several folders, in every command."""

from __future__ import annotations

import json
import shlex
import shutil
from pathlib import Path

import pytest

from tests.worlds.cli import assert_refused, run
from tests.worlds.trees import document
from uav_bt.app.view.recorded import RecordedFlight
from uav_bt.campaign.report.sources import read_sources
from uav_bt.campaign.report.tables import tables_of
from uav_bt.record.reader import RecordReader

SMALL = ("--image-size", "160x90", "--profile", "ideal")
LEAVES = ["TakeOff", "HoverFor", "Land", "AlwaysSuccess"]


def write(path: Path, tree_id: str, body: str, includes: str = "") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    text = document(f"\n{body}\n", tree_id=tree_id)
    path.write_text(text.replace("<BehaviorTree", f"{includes}\n<BehaviorTree"), encoding="utf-8")
    return path


class Mission:
    """A mission whose trees are in four folders: its own, one above, a library, a ROS package."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.path = write(
            folder / "missions" / "hop.xml",
            "Main",
            '<Sequence><SubTree ID="Up"/><SubTree ID="Wait"/><SubTree ID="Down"/></Sequence>',
            '<include path="../shared/up.xml"/><include ros_pkg="robot" path="trees/wait.xml"/>',
        )
        write(folder / "shared" / "up.xml", "Up", '<TakeOff height_m="1.0"/>')
        # As after `colcon build --symlink-install`: the installed file is a link to its source.
        source = folder / "src" / "robot" / "trees" / "wait.xml"
        write(source, "Wait", '<HoverFor seconds="0.2"/>', '<include path="deep/more.xml"/>')
        write(source.parent / "deep" / "more.xml", "More", "<AlwaysSuccess/>")
        installed = folder / "install" / "robot" / "trees"
        installed.mkdir(parents=True)
        (installed / "wait.xml").symlink_to(source)
        # Beside it an invalid tree that no file uses; it is never loaded.
        write(folder / "parts" / "other.xml", "Other", "<Nonsense/>")
        self.down = write(
            folder / "parts" / "deep" / "down.xml",
            "Down",
            '<Sequence><Land/><SubTree ID="More"/></Sequence>',
        )
        self.options = (
            *("--trees", folder / "parts", "--include-root", folder),
            *("--ros-pkg", f"robot={folder / 'install' / 'robot'}"),
        )


@pytest.fixture
def mission(tmp_path: Path) -> Mission:
    return Mission(tmp_path / "workspace")


def commands(mission: Path, tmp_path: Path) -> list[tuple[object, ...]]:
    """Return a call of every command that loads a tree file."""
    script = tmp_path / "answers.yaml"
    script.write_text("default: S")
    return [
        ("check", mission),
        ("tree", "render", mission),
        ("simulate", mission, "--script", script),
        ("fly", mission, *SMALL),
        ("campaign", mission, "--scenes", "val-a", "--out", tmp_path / "campaign"),
    ]


def test_every_command_finds_the_trees_of_other_folders(mission: Mission, tmp_path: Path) -> None:
    check, render, simulate, _, _ = commands(mission.path, tmp_path)
    assert run(*check, *mission.options).exit_code == 0
    drawn = run(*render, *mission.options).stdout
    assert [word for word in drawn.split() if word in LEAVES] == LEAVES
    simulated = run(*simulate, *mission.options, "--format", "json")
    assert simulated.exit_code == 0, simulated.output
    ticked = [leaf["leaf"] for leaf in json.loads(simulated.stdout)["ticks"][0]["leaves"]]
    assert ticked == LEAVES


def test_every_command_refuses_what_is_no_folder(mission: Mission, tmp_path: Path) -> None:
    trees, root, package = (mission.options[at : at + 2] for at in (0, 2, 4))
    none, twice = tmp_path / "none", ("--ros-pkg", f"robot={tmp_path}") * 2
    for command in commands(mission.path, tmp_path):
        for given, words in (
            ((*root, *package), f"{mission.path}:3:"),
            ((*trees, *package), "allow it with --include-root DIR"),
            ((*trees, *root), "package 'robot' is not known here: add --ros-pkg robot=DIR"),
            (("--trees", none), "none: no such folder"),
            (("--include-root", none), "none: no such folder"),
            (("--ros-pkg", f"robot={none}"), "none: no such folder"),
            (twice, "package 'robot' is given two values"),
        ):
            assert_refused(run(*command, *given), words)


def test_a_record_replays_without_the_folders(mission: Mission, tmp_path: Path) -> None:
    """It contains all used files, including links, and no others. A report replaces none."""
    record = tmp_path / "flight.mcap"
    flight = ("fly", mission.path, *SMALL, *mission.options)
    for file in (mission.down, mission.folder / "src" / "robot" / "trees" / "wait.xml"):
        words = "is an input and would be overwritten"
        assert_refused(run(*flight, "--report", file), words)
    flown = run(*flight, "--record", record)
    assert flown.exit_code == 0, flown.output
    again = ("replay", record, "--tree", mission.path)
    assert "0 in commands; the same" in run(*again, *mission.options).stdout
    assert_refused(run(*again), "allow it with --include-root DIR")
    assert_refused(run("replay", record, *mission.options), "folders are for another --tree")
    shutil.rmtree(mission.folder)
    assert set(RecordReader(record).attachments) == {"tree/hop.xml", "scene.yaml"}
    replayed = run("replay", record)
    assert replayed.exit_code == 0, replayed.output
    assert "0 differ in statuses, 0 in commands; the same" in replayed.stdout
    seen = RecordedFlight(record).tree
    assert seen is not None
    assert [leaf.name for leaf in seen.leaves()] == LEAVES


def test_a_record_keeps_the_trees_of_the_library_that_it_flew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shipped = write(tmp_path / "trees" / "lib" / "hop.xml", "Hop", "<AlwaysSuccess/>")
    monkeypatch.setattr("uav_bt.tree.loading.lookup.shipped_trees", lambda: tmp_path / "trees")
    body = '<Sequence><TakeOff height_m="1.0"/><SubTree ID="Hop"/><Land/></Sequence>'
    mission, record = write(tmp_path / "own" / "m.xml", "Main", body), tmp_path / "flight.mcap"
    flown = run("fly", mission, *SMALL, "--record", record)
    assert flown.exit_code == 0, flown.output
    assert b'<BehaviorTree ID="Hop">' in RecordReader(record).attachments["tree/m.xml"].data
    write(shipped, "Hop", "<AlwaysFailure/>")
    replayed = run("replay", record)
    assert replayed.exit_code == 0, replayed.output
    assert "0 differ in statuses, 0 in commands; the same" in replayed.stdout


def test_a_campaign_keeps_its_folders(
    mission: Mission, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Folders given by relative paths are found from elsewhere; changed files are named."""
    monkeypatch.chdir(mission.folder)
    out = tmp_path / "out"
    options = ("--trees", "parts", "--include-root", ".", "--ros-pkg", "robot=install/robot")
    small = (*SMALL, "--exact-masks", "--workers", 1)
    command = ("campaign", "missions/hop.xml", "--scenes", "val-a", "--flights", 1)
    flown = run(*command, *small, *options, "--out", out)
    assert flown.exit_code == 0, flown.output
    assert "success 1" in flown.stdout
    monkeypatch.chdir(tmp_path)
    resumed = run("campaign", "--resume", out, "--workers", 1)
    assert resumed.exit_code == 0, resumed.output
    assert_refused(run("campaign", "--resume", out, *mission.options), "leave out --trees")
    text = mission.down.read_text()
    mission.down.write_text(text.replace("<Land/>", "<ForceSuccess><Land/></ForceSuccess>"))
    words = ("holds another campaign", "trees hop.xml sha256 has changed")
    assert_refused(run("campaign", "--resume", out), *words)
    mission.down.write_text(text)
    shutil.rmtree(mission.folder / "parts")
    assert_refused(run("campaign", "--resume", out), "parts: no such folder to look for tree files")


def test_a_failure_is_flown_again_with_its_folders(
    mission: Mission, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A report without these options still has the folders of the campaign's command."""
    write(mission.down, "Down", "<AlwaysFailure/>")
    out = tmp_path / "out"
    command = ("campaign", mission.path, "--scenes", "val-a", "--flights", 1, "--workers", 1)
    assert run(*command, *SMALL, *mission.options, "--out", out).exit_code == 0
    there = mission.folder.rename(tmp_path / "away")
    (row,) = tables_of(read_sources([out]), tmp_path / "page.html")["failures"].rows
    there.rename(mission.folder)
    words = shlex.split(str(row[-1]))
    options = [str(word) for word in mission.options]
    assert words[-len(options) - 2 : -2] == options
    monkeypatch.chdir(tmp_path)  # for the output folder
    again = run(*words[1:], "--report", tmp_path / "again.json")
    assert again.exit_code == 1, again.output
    (first,) = [json.loads(line) for line in (out / "flights.jsonl").read_text().splitlines()]
    second = json.loads((tmp_path / "again.json").read_text())
    assert second["reason"] == first["reason"]
    assert second["ticks"] == first["ticks"]


def test_leaves_of_a_python_file_are_known_to_every_command(tmp_path: Path) -> None:
    leaves = tmp_path / "my_leaves.py"
    leaves.write_text(
        "from uav_bt.tree import Leaf, Status\n"
        "class Wait(Leaf):\n"
        '    """SUCCESS at once."""\n'
        "    def update(self):\n"
        "        return Status.SUCCESS\n"
    )
    body = '<Sequence><TakeOff height_m="1.0"/><Wait/><Land/></Sequence>'
    tree = write(tmp_path / "wait.xml", "Main", body)
    script = tmp_path / "answers.yaml"
    script.write_text("default: S\n")
    report, record = tmp_path / "report.json", tmp_path / "flight.mcap"
    given = ("--leaves", leaves)
    flight = ("fly", tree, *given, *SMALL, "--exact-masks", "--set", "TakeOff.height_m=1.1")
    assert_refused(run("check", tree), "unknown node 'Wait'; --leaves FILE.py")
    for command in (
        ("check", tree, *given),
        ("simulate", tree, "--script", script, *given),
        ("tree", "nodes", "Wait", *given),
        ("tree", "render", tree, *given),
        (*flight, "--time-limit", "90", "--report", report, "--record", record),
        ("replay", record, *given),
    ):
        result = run(*command)
        assert result.exit_code == 0, result.output
    assert json.loads(report.read_text())["ports"] == {"TakeOff.height_m": "1.1"}
    assert_refused(run(*flight, "--record", leaves), "--record")
    late = run(*flight, "--time-limit", "2")
    assert late.exit_code == 1
    assert "timeout" in late.output
