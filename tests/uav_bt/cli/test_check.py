"""`uav-bt check` finds all problems of all files; `uav-bt new` writes a first mission."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from perception.networks.weights_file import SHIPPED_WEIGHTS
from tests.worlds.cli import HOP, assert_refused, run, tree_file
from uav_bt.tree.shipped import shipped_missions


@pytest.mark.parametrize("path", sorted(shipped_missions().values()), ids=lambda path: path.stem)
def test_shipped_missions_are_good_by_file_and_by_name(path: Path) -> None:
    by_file, by_name = run("check", path), run("check", path.stem)
    assert (by_file.exit_code, by_name.exit_code) == (0, 0), by_file.output + by_name.output
    assert by_file.stdout == f"{path}: good\n"


def test_all_findings_of_all_files_are_reported_with_their_lines(tmp_path: Path) -> None:
    good = tree_file(tmp_path, HOP, "good.xml")
    bad = tree_file(tmp_path, '<Sequence>\n<TakOff/>\n<Land hight="1"/>\n</Sequence>', "bad.xml")
    worse = tree_file(tmp_path, "<Sequence>", "worse.xml")
    result = run("check", bad, good, worse)
    assert result.exit_code == 2
    assert result.stdout == f"{good}: good\n"
    lines = result.stderr.splitlines()
    assert len(lines) == 3
    assert lines[0].startswith(f"{bad}:4:")
    assert "did you mean 'TakeOff'" in lines[0]
    assert lines[1].startswith(f"{bad}:5:")
    assert "hight" in lines[1]
    assert lines[2].startswith(f"{worse}:")


# --- folders, palettes, JSON ----------------------------------------------------------------------


def test_a_folder_stands_for_all_tree_files_in_it(tmp_path: Path) -> None:
    (tmp_path / "more").mkdir()
    (tmp_path / ".hidden").mkdir()
    first = tree_file(tmp_path, HOP, "a.xml")
    second = tree_file(tmp_path / "more", HOP, "b.xml")
    tree_file(tmp_path / ".hidden", "<Unknown/>")
    (tmp_path / "notes.txt").write_text("no tree", encoding="utf-8")
    result = run("check", tmp_path)
    assert (result.exit_code, result.stdout) == (0, f"{first}: good\n{second}: good\n")


def test_a_foreign_tree_is_checked_with_its_palette(tmp_path: Path) -> None:
    palette = tmp_path / "palette.txt"
    palette.write_text(
        '<root BTCPP_format="4"><TreeNodesModel><Action ID="DockRobot"><input_port name="dock" '
        'type="int"/><input_port name="policy" type="std::string"/></Action></TreeNodesModel>'
        "</root>",
        encoding="utf-8",
    )
    good = tree_file(tmp_path, '<DockRobot dock="1" policy="of their own"/>', "good.xml")
    bad = tree_file(tmp_path, '<DockRobot dock="one"/>', "bad.xml")
    result = run("check", good, bad, "--palette", palette)
    assert (result.exit_code, result.stdout) == (2, f"{good}: good\n")
    assert "expected an integer, got 'one'" in result.stderr
    assert "unknown node 'DockRobot'" in run("check", good).stderr
    assert_refused(run("check", good, "--palette", bad), "expected a <TreeNodesModel>")
    assert_refused(run("check", good, "--palette", tmp_path / "absent.xml"), "no such file")


def test_json_has_one_object_a_line_and_file(tmp_path: Path) -> None:
    good = tree_file(tmp_path, HOP, "good.xml")
    bad = tree_file(tmp_path, '<Sequence>\n<Land\n  hight="1"/>\n</Sequence>', "bad.xml")
    result = run("check", good, bad, tmp_path / "absent.xml", "--format", "json")
    assert (result.exit_code, result.stderr) == (2, "")
    first, second, third = (json.loads(line) for line in result.stdout.splitlines())
    assert first == {"file": str(good), "ok": True, "findings": []}
    names = ("path", "line", "column", "node", "severity", "rule")
    absent = str(tmp_path / "absent.xml")
    for report, message, values in (
        (second, "unknown attribute 'hight'", (str(bad), 5, 3, "Land", "error", "attribute")),
        (third, "no such tree file", (absent, None, None, "", "error", "file")),
    ):
        (finding,) = report["findings"]
        assert finding.pop("message").startswith(message)
        assert finding == dict(zip(names, values, strict=True))
        assert (report["file"], report["ok"]) == (values[0], False)


@pytest.mark.parametrize(
    ("body", "rule"),
    [
        ('<Land hight="1"/>', "attribute"),
        ('<Script code="1 +"/>', "script"),
        ('<Land _skipIf="1 +"/>', "script"),
        ('<AlwaysSuccess _skipIf="@hight > 1"/>', "board-key"),
        ('<SubTree ID="Absent"/>', "unknown-tree"),
        ('<SubTree ID="Main"/>', "unknown-tree"),
        ("<Inverter/>", "children"),
        ('<Sequence><Script code="x:=\'a\'"/><TakeOff height_m="{x}"/></Sequence>', "variable"),
        ('<Explore policy="segmentatio"/>', "not-installed"),
        ('<Rules area="file:absent.csv"/>', "places"),
        ('<SetBlackboard value="1" output_key="x" _x="1"/>', "no-meaning"),
    ],
)
def test_findings_have_the_rule_that_they_are_about(body: str, rule: str, tmp_path: Path) -> None:
    body = body.replace(" > ", " &gt; ")
    report = json.loads(run("check", tree_file(tmp_path, body), "--format", "json").stdout)
    assert {finding["rule"] for finding in report["findings"]} == {rule}, report


# --- new ------------------------------------------------------------------------------------------


def test_a_new_mission_is_written_once_and_is_good(tmp_path: Path) -> None:
    path = tmp_path / "mine.xml"
    result = run("new", path, "--from", "land")
    assert (result.exit_code, result.stdout[: len(f"written: {path}")]) == (0, f"written: {path}")
    assert run("check", path).stdout == f"{path}: good\n"
    assert_refused(run("new", path), "not overwritten")
    assert_refused(run("new", tmp_path / "other.xml", "--from", "lan"), "--from")


@pytest.mark.parametrize(
    ("leaf", "words"),
    [
        ('Say text="{@height_m}"', ["no key 'height_m'; did you mean 'flight_height_m'?"]),
        ('Explore policy="coridor"', ["unknown policy 'coridor'; did you mean 'corridor'?"]),
        ('Segment model="unett"', ["'model': unknown segmentation model 'unett'; did you mean"]),
        ('Segment model="text.onnx"', ["text.onnx: is not a readable ONNX network"]),
        ('Segment model="net.safetensors"', ["the weights of a training", "'net.onnx'"]),
        ('Segment classes="nofile.yaml"', ["'classes': nofile.yaml: there is no such"]),
        ('EstimateDepth model="dept"', ["unknown depth model 'dept'; did you mean 'depth'?"]),
        ('Explore policy="student:nofile.onnx"', ["'policy': nofile.onnx: there is no such"]),
        ('Explore policy="corridor:nofile.onnx"', ["policy 'corridor' takes no argument"]),
    ],
)
def test_names_and_networks_that_are_not_there_are_found(
    leaf: str, words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "text.onnx").write_text("no network")
    (tmp_path / "net.safetensors").write_bytes(b"\x02\0\0\0\0\0\0\0{}")
    tree = tree_file(tmp_path, f"<Sequence>\n<{leaf}/>\n</Sequence>")
    tag, _, attribute = leaf.partition(" ")
    column = len(f"<{tag} ") + 1 if attribute else 1
    assert_refused(run("check", tree), f"{tree}:4:{column}: ", *words)
    if ".onnx" in leaf:
        assert run("tree", "render", tree).exit_code == 0  # leaves that load nothing


@pytest.mark.parametrize(
    "leaf",
    [
        'Segment model="teacher"',
        'Segment model="{which}"',
        'Explore policy="{which}"',
        'EstimateDepth model="contact"',
        'Explore policy="student"',
        'Explore policy="student:{shipped}"',
    ],
)
def test_networks_that_are_there_are_good(leaf: str, tmp_path: Path) -> None:
    leaf = leaf.replace("{shipped}", str(SHIPPED_WEIGHTS / "student.onnx"))
    tree = tree_file(tmp_path, f'<Sequence><Script code="which:=1"/><{leaf}/></Sequence>')
    result = run("check", tree)
    assert result.exit_code == 0, result.output


TWO = (
    '<root BTCPP_format="4"><BehaviorTree ID="Up"><TakeOff height_m="1.0"/></BehaviorTree>'
    '<BehaviorTree ID="Down"><Land/></BehaviorTree></root>'
)


def test_a_tree_of_several_can_be_chosen_everywhere(tmp_path: Path) -> None:
    """Groot2 does not save which tree is flown."""
    path = tmp_path / "two.xml"
    path.write_text(TWO)
    script = tmp_path / "answers.yaml"
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


def test_a_warning_is_no_reason_to_refuse(tmp_path: Path) -> None:
    path = tree_file(tmp_path, '<Land _skpIf="true"/>')
    result = run("check", path)
    assert (result.exit_code, result.stdout) == (0, f"{path}: good\n")
    assert result.stderr == (
        f"{path}:3:7: warning: Land: attribute '_skpIf' means nothing here; did you mean "
        "'_skipIf'?\n"
    )
    report = json.loads(run("check", path, "--format", "json").stdout)
    assert report["ok"] is True
    assert report["findings"][0]["severity"] == "warning"


def test_a_height_above_the_ceiling_is_a_warning(tmp_path: Path) -> None:
    """A site may have a different ceiling; without a site the flight is refused."""
    path = tree_file(tmp_path, '<Sequence>\n<TakeOff height_m="15"/>\n<Land/>\n</Sequence>')
    result = run("check", path)
    assert (result.exit_code, result.stdout) == (0, f"{path}: good\n")
    assert result.stderr.startswith(f"{path}:4:10: warning: Main/Sequence/TakeOff: ")
    assert "attribute 'height_m': 15 m lies above the ceiling of 2.4 m" in result.stderr
    assert_refused(run("fly", path), "above the ceiling of 2.4 m")
    at_it = tree_file(tmp_path, '<Sequence><TakeOff height_m="2.4"/><Land/></Sequence>')
    assert run("check", at_it).stderr == ""


def test_a_folder_is_one_workspace(tmp_path: Path) -> None:
    """Trees of other files are found, and problems appear only in the report of their file."""
    used = tree_file(tmp_path, '<Land hight="1"/>', "used.xml")
    used.write_text(used.read_text().replace("Main", "Used"))
    user = tree_file(tmp_path, '<SubTree ID="Used"/>', "user.xml")
    result = run("check", tmp_path)
    assert (result.exit_code, result.stdout) == (2, f"{user}: good\n")
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith(f"{used}:3:7: ")
    assert "there is no tree 'Used'; --trees DIR" in run("check", user).stderr
    used.write_text(used.read_text().replace(' hight="1"', ""))
    elsewhere = tree_file(tmp_path / "..", "<AlwaysSuccess/>", f"{tmp_path.name}.xml")
    elsewhere.write_text(user.read_text())
    user.unlink()
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


GOOD = '<root BTCPP_format="4"><BehaviorTree ID="M"><AlwaysSuccess/></BehaviorTree></root>'


@pytest.mark.parametrize("name", ["-", "/dev/stdin"])
def test_standard_input_is_checked(name: str) -> None:
    def check(text: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "uav_bt", "check", name]
        return subprocess.run(  # noqa: S603 - our own program
            command, check=False, input=text, text=True, capture_output=True
        )

    good = check(GOOD)
    called = "<stdin>" if name == "-" else name
    assert (good.returncode, good.stdout, good.stderr) == (0, f"{called}: good\n", "")
    refused = check(GOOD.replace("Always", "Alway"))
    assert refused.returncode == 2
    assert refused.stderr.startswith(f"{called}:1:45: AlwaySuccess: unknown node 'AlwaySuccess'")


def test_a_pipe_is_checked(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    threading.Thread(target=pipe.write_text, args=(GOOD,), daemon=True).start()
    result = run("check", pipe)
    assert (result.exit_code, result.stdout) == (0, f"{pipe}: good\n")
