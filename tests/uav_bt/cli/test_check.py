"""`uav-bt check` finds all problems of all files; `uav-bt new` writes a first mission."""

from __future__ import annotations

import json
import os
import threading
from pathlib import Path

import pytest

from perception.networks.weights_file import SHIPPED_WEIGHTS
from tests.worlds.cli import HOP, assert_refused, run, tree_file
from tests.worlds.processes import python
from tests.worlds.tables import cases
from uav_bt.tree.shipped import shipped_missions


@pytest.mark.parametrize("path", sorted(shipped_missions().values()), ids=lambda path: path.stem)
def test_shipped_missions_are_good_by_file_and_by_name(path: Path) -> None:
    by_file, by_name = run("check", path), run("check", path.stem)
    assert (by_file.exit_code, by_name.exit_code) == (0, 0), by_file.output + by_name.output
    assert by_file.stdout == f"{path}: good\n"


def test_all_findings_of_all_files_are_reported_with_their_places(tmp_path: Path) -> None:
    good, absent = tree_file(tmp_path, HOP, "good.xml"), tmp_path / "absent.xml"
    bad = tree_file(tmp_path, '<Sequence>\n<TakOff/>\n<Land\n  hight="1"/>\n</Sequence>', "bad.xml")
    result = run("check", bad, good, absent)
    assert (result.exit_code, result.stdout) == (2, f"{good}: good\n")
    lines = result.stderr.splitlines()
    places = (f"{bad}:4:1: TakOff: unknown", f"{bad}:6:3: Land: unknown attribute", f"{absent}: no")
    assert [line[: len(at)] for line, at in zip(lines, places, strict=True)] == [*places]
    assert "did you mean 'TakeOff'" in lines[0]
    result = run("check", good, bad, absent, "--format", "json")
    assert (result.exit_code, result.stderr) == (2, "")
    first, second, third = (json.loads(line) for line in result.stdout.splitlines())
    assert first == {"file": str(good), "ok": True, "findings": []}
    names = ("path", "line", "column", "node", "severity", "rule")
    for report, message, values in (
        (second, "unknown attribute 'hight'", (str(bad), 6, 3, "Land", "error", "attribute")),
        (third, "no such tree file", (str(absent), None, None, "", "error", "file")),
    ):
        finding = report["findings"][-1]
        assert finding.pop("message").startswith(message)
        assert finding == dict(zip(names, values, strict=True))
        assert (report["file"], report["ok"]) == (values[0], False)


@pytest.mark.parametrize(("body", "column", "rule", "words"), cases("refusals")["findings"])
def test_a_finding_has_its_place_its_rule_and_its_cure(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    *,
    body: str,
    column: int,
    rule: str,
    words: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "text.onnx").write_text("no network")
    (tmp_path / "net.safetensors").write_bytes(b"\x02\0\0\0\0\0\0\0{}")
    tree = tree_file(tmp_path, body)
    report = json.loads(run("check", tree, "--format", "json").stdout)
    (finding,) = report["findings"]
    assert words in finding["message"]
    assert (finding["line"], finding["column"], finding["rule"]) == (3, column, rule)
    if ".onnx" in body:
        assert run("tree", "render", tree).exit_code == 0  # leaves that load nothing


def test_networks_that_are_there_are_good(tmp_path: Path) -> None:
    leaves = (
        *('Segment model="teacher"', 'Segment model="{which}"', 'Explore policy="{which}"'),
        *('EstimateDepth model="contact"', 'Explore policy="student"'),
        f'Explore policy="student:{SHIPPED_WEIGHTS / "student.onnx"}"',
    )
    for leaf in leaves:
        tree = tree_file(tmp_path, f'<Sequence><Script code="which:=1"/><{leaf}/></Sequence>')
        assert run("check", tree).stdout == f"{tree}: good\n", leaf


def test_a_warning_is_no_reason_to_refuse(tmp_path: Path) -> None:
    """A site may have a different ceiling; without a site the flight is refused."""
    path = tree_file(
        tmp_path, '<Sequence>\n<TakeOff height_m="15"/>\n<Land _skpIf="1"/></Sequence>'
    )
    result = run("check", path)
    assert (result.exit_code, result.stdout) == (0, f"{path}: good\n")
    high, skip = sorted(result.stderr.splitlines())
    assert high.startswith(f"{path}:4:10: warning: Main/Sequence/TakeOff: ")
    assert "attribute 'height_m': 15 m lies above the ceiling of 2.4 m" in high
    words = "attribute '_skpIf' means nothing here; did you mean '_skipIf'?"
    assert skip == f"{path}:5:7: warning: Land: {words}"
    report = json.loads(run("check", path, "--format", "json").stdout)
    assert report["ok"] is True
    assert {one["severity"] for one in report["findings"]} == {"warning"}
    assert_refused(run("fly", path), "above the ceiling of 2.4 m")
    at_it = tree_file(tmp_path, '<Sequence><TakeOff height_m="2.4"/><Land/></Sequence>')
    assert run("check", at_it).stderr == ""


TWO = (
    '<root BTCPP_format="4"><BehaviorTree ID="Up"><TakeOff height_m="1.0"/></BehaviorTree>'
    '<BehaviorTree ID="Down"><Land/></BehaviorTree></root>'
)


def test_a_tree_of_several_can_be_chosen_everywhere(tmp_path: Path) -> None:
    """Groot2 does not save which tree is flown."""
    path, script = tmp_path / "two.xml", tmp_path / "answers.yaml"
    path.write_text(TWO)
    script.write_text("default: S")
    assert run("check", path).exit_code == 0
    for command in (
        ("tree", "render", path),
        ("simulate", path, "--script", script),
        ("fly", path),
        ("campaign", path, "--flights", "1", "--out", tmp_path / "runs"),
    ):
        assert_refused(run(*command), "which of these trees is meant: Up, Down?", "--tree ID")
        assert_refused(run(*command, "--tree", "Dwn"), "no tree 'Dwn'; did you mean 'Down'?")
    assert "Land" in run("tree", "render", path, "--tree", "Down").stdout
    assert run("simulate", path, "--script", script, "--tree", "Up").exit_code == 0


def test_a_new_mission_is_good(tmp_path: Path) -> None:
    path = tmp_path / "mine.xml"
    assert run("new", path, "--from", "land").stdout.startswith(f"written: {path}")
    assert run("check", path).stdout == f"{path}: good\n"


# --- folders and used files -----------------------------------------------------------------------


def test_a_folder_stands_for_its_tree_files_and_is_one_workspace(tmp_path: Path) -> None:
    """Trees of other files are found, and problems appear only in the report of their file."""
    for folder in ("more", ".hidden"):
        (tmp_path / folder).mkdir()
    tree_file(tmp_path / ".hidden", "<Unknown/>")
    (tmp_path / "notes.txt").write_text("no tree", encoding="utf-8")
    first = tree_file(tmp_path / "more", HOP, "a.xml")
    used = tree_file(tmp_path, '<Land hight="1"/>', "used.xml")
    used.write_text(used.read_text().replace("Main", "Used"))
    user = tree_file(tmp_path, '<SubTree ID="Used"/>', "user.xml")
    result = run("check", tmp_path)
    assert (result.exit_code, result.stdout) == (2, f"{first}: good\n{user}: good\n")
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith(f"{used}:3:7: ")
    assert "there is no tree 'Used'; --trees DIR" in run("check", user).stderr
    used.write_text(used.read_text().replace(' hight="1"', ""))
    elsewhere = user.rename(tmp_path.parent / f"{tmp_path.name}.xml")
    assert run("check", elsewhere, "--trees", tmp_path).exit_code == 0
    assert "SubTree" in run("tree", "render", elsewhere, "--trees", tmp_path).stdout


@pytest.mark.parametrize("through", ["include", "library"])
@pytest.mark.parametrize(
    ("body", "code", "words"),
    [
        ('<Land _skpIf="true"/>', 0, "4:7: warning: Land: attribute '_skpIf' means nothing here"),
        ('<TakeOff height_m="15"/>', 0, "/TakeOff: attribute 'height_m': 15 m lies above"),
        ('<Land hight="1"/>', 2, "4:7: Land: unknown attribute 'hight'"),
        ('<Explore policy="none"/>', 2, "policy 'none'"),
    ],
)
def test_what_is_wrong_with_a_used_file_is_reported_once(
    tmp_path: Path, through: str, body: str, code: int, words: str
) -> None:
    """It is in the used file's report if that is in the folder, else in the user's report."""
    folder = tmp_path / "folder"
    (folder / "sub").mkdir(parents=True)
    part = folder / "sub" / "b.xml"
    include = '<include path="sub/b.xml"/>' if through == "include" else ""
    user = tree_file(folder, '<Sequence><TakeOff/><SubTree ID="B"/><Land/></Sequence>', "a.xml")
    user.write_text(user.read_text().replace('4">', f'4" main_tree_to_execute="Main">{include}'))
    part.write_text(
        f'<root BTCPP_format="4">\n<BehaviorTree ID="B">\n\n{body}\n</BehaviorTree>\n</root>\n'
    )

    def lines(*arguments: object) -> list[str]:
        result = run("check", *arguments)
        assert result.exit_code == code, result.output
        return [line for line in result.stderr.splitlines() if words in line]

    (line,) = lines(folder)
    assert line.startswith(f"{part}:")
    reports = map(json.loads, run("check", folder, "--format", "json").stdout.splitlines())
    assert [report["findings"] for report in reports if report["file"] == str(user)] == [[]]
    part.parent.rename(tmp_path / "outside")
    user.write_text(user.read_text().replace("sub/b.xml", "../outside/b.xml"))
    (line,) = lines(folder, "--include-root", tmp_path, "--trees", tmp_path / "outside")
    assert line.startswith(f"{tmp_path / 'outside' / 'b.xml'}:")


@pytest.mark.parametrize("include", ["", '<include path="sub/b.xml"/>'])
def test_what_is_wrong_only_in_the_use_of_a_file_is_reported(tmp_path: Path, include: str) -> None:
    """Alone, the used file is valid: its variable could be set from Python."""
    (tmp_path / "sub").mkdir()
    part = tree_file(tmp_path / "sub", '<AlwaysSuccess _failureIf="x"/>', "b.xml")
    part.write_text(part.read_text().replace("Main", "B"))
    user = tree_file(tmp_path, '<SubTree ID="B"/>', "a.xml")
    user.write_text(user.read_text().replace("<BehaviorTree", f"{include}<BehaviorTree"))
    result = run("check", tmp_path)
    assert (result.exit_code, result.stdout) == (2, f"{part}: good\n")
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith(f"{part}:3:16: AlwaysSuccess: ")
    assert f"nothing writes variable 'x' of tree 'B', and SubTree 'B' at {user}:3:" in result.stderr
    user.write_text(user.read_text().replace('ID="B"/>', 'ID="B" x="0"/>'))
    assert run("check", tmp_path).exit_code == 0


# --- pipes ----------------------------------------------------------------------------------------

GOOD = '<root BTCPP_format="4"><BehaviorTree ID="M"><AlwaysSuccess/></BehaviorTree></root>'


@pytest.mark.parametrize("name", ["-", "/dev/stdin"])
def test_standard_input_is_checked(name: str) -> None:
    called = "<stdin>" if name == "-" else name
    unknown = "1:45: AlwaySuccess: unknown node 'AlwaySuccess'"
    for text, code, told in ((GOOD, 0, " good\n"), (GOOD.replace("Always", "Alway"), 2, unknown)):
        done = python("-m", "uav_bt", "check", name, input=text)
        printed = done.stderr if code else done.stdout
        assert (done.returncode, printed[: len(called) + 1]) == (code, f"{called}:")
        assert printed[len(called) + 1 :].startswith(told)


def test_a_pipe_is_checked(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    threading.Thread(target=pipe.write_text, args=(GOOD,), daemon=True).start()
    result = run("check", pipe)
    assert (result.exit_code, result.stdout) == (0, f"{pipe}: good\n")
