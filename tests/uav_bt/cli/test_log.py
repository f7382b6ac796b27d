"""`uav-bt log`, and the options of `uav-bt fly` that write logs and let Groot2 watch."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.uav_bt.cli.cli_world import HOP, assert_refused, run, tree_file
from uav_bt.errors import InputError
from uav_bt.groot import BtlogWriter, NodeStatus, Transition

XML = """
<root BTCPP_format="4"><BehaviorTree ID="Main" _fullpath="">
  <Sequence name="all" _uid="1"><Land name="down" _uid="2"/></Sequence>
</BehaviorTree></root>"""
RUNNING, SUCCESS, IDLE = NodeStatus.RUNNING, NodeStatus.SUCCESS, NodeStatus.IDLE


@pytest.fixture
def logged(tmp_path: Path) -> Path:
    path = tmp_path / "flight.btlog"
    with BtlogWriter(path) as log:
        log.begin(XML, 2_000_000)
        log.write(
            [
                Transition(2_000_000, 1, RUNNING),
                Transition(2_000_000, 2, RUNNING),
                Transition(3_500_000, 2, SUCCESS),
                Transition(3_500_000, 2, IDLE),
                Transition(4_000_000, 2, RUNNING),
                Transition(4_250_000, 2, IDLE),
            ]
        )
    return path


def test_transitions_are_printed_one_a_line(logged: Path) -> None:
    result = run("log", logged)
    assert result.exit_code == 0, result.output
    assert [line.split() for line in result.stdout.splitlines()] == [
        ["time", "s", "uid", "status", "node"],
        ["0.000", "1", "RUNNING", "Main/all"],
        ["0.000", "2", "RUNNING", "Main/all/down"],
        ["1.500", "2", "SUCCESS", "Main/all/down"],
        ["1.500", "2", "IDLE", "Main/all/down"],
        ["2.000", "2", "RUNNING", "Main/all/down"],
        ["2.250", "2", "IDLE", "Main/all/down"],
    ]


def test_transitions_are_printed_as_json_lines(logged: Path) -> None:
    lines = run("log", logged, "--format", "jsonl").stdout.splitlines()
    assert json.loads(lines[2]) == {
        "time_s": 1.5,
        "uid": 2,
        "status": "SUCCESS",
        "node": "Main/all/down",
    }
    assert len(lines) == 6


def test_durations_are_printed_for_each_node(logged: Path) -> None:
    rows = [line.split() for line in run("log", logged, "--durations").stdout.splitlines()]
    assert rows[1:] == [
        ["2.250", "2.250", "1", "0", "0", "0", "Main/all", "(still", "running)"],
        ["1.750", "1.500", "2", "1", "0", "1", "Main/all/down"],
    ]
    told = json.loads(run("log", logged, "--durations", "--format", "jsonl").stdout.splitlines()[1])
    assert told == {
        "uid": 2,
        "node": "Main/all/down",
        "activations": 2,
        "running_s": 1.75,
        "longest_s": 1.5,
        "successes": 1,
        "failures": 0,
        "halts": 1,
        "still_running": False,
    }


def test_a_log_cut_short_is_printed_with_a_word_on_what_is_missing(logged: Path) -> None:
    logged.write_bytes(logged.read_bytes()[:-4])
    result = run("log", logged)
    assert result.exit_code == 0
    assert len(result.stdout.splitlines()) == 6
    assert "cut short; its last 5 bytes are no whole record" in result.stderr


def test_what_is_no_log_is_refused(logged: Path, tmp_path: Path) -> None:
    assert_refused(run("log", tmp_path / "absent.btlog"), "absent.btlog: cannot be read")
    assert_refused(run("log", tree_file(tmp_path, HOP)), "mission.xml: byte 0: no log of FileLog")


def test_a_transition_of_nobody_is_refused_with_its_byte(logged: Path) -> None:
    size = logged.stat().st_size
    logged.write_bytes(logged.read_bytes() + bytes(6) + b"\x63\0\x01")
    result = run("log", logged)
    assert result.exit_code == 2
    assert f"byte {size}: a transition of node 99" in result.stderr


# --- fly ------------------------------------------------------------------------------------------


def test_a_flight_leaves_a_log_that_can_be_printed(tmp_path: Path) -> None:
    path = tmp_path / "flight.btlog"
    options = ("--image-size", "160x90", "--profile", "ideal")
    result = run("fly", tree_file(tmp_path, HOP), *options, "--btlog", path)
    assert result.exit_code == 0, result.output
    assert f"btlog: {path}" in result.stdout
    told = [
        json.loads(line)
        for line in run("log", path, "--durations", "--format", "jsonl").stdout.splitlines()
    ]
    assert [(item["node"], item["successes"]) for item in told] == [
        ("Main/Sequence", 1),
        ("Main/Sequence/TakeOff", 1),
        ("Main/Sequence/Land", 1),
    ]


@pytest.mark.parametrize(
    ("arguments", "port"),
    [
        (("land_only",), None),
        (("land_only", "--groot"), 1667),
        (("--groot", 2000, "land_only"), 2000),
    ],
)
def test_groot2_is_served_only_when_asked(
    arguments: tuple[str, ...], port: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []

    def refuse(**options: Any) -> None:
        asked.append(options)
        raise InputError("enough")

    monkeypatch.setattr("uav_bt.groot.watch.watched_live", refuse)
    assert_refused(run("fly", *arguments), "enough")
    (options,) = asked
    assert options["btlog"] is None
    assert (options["groot"] and options["groot"].port) == port


@pytest.mark.parametrize("port", ["0", "65535", "x", "land_only"])
def test_a_port_that_is_none_is_refused_with_a_hint(port: str) -> None:
    result = run("fly", "--groot", port, "land_only")
    assert_refused(result, f"got '{port}'", "--groot without a port after TREE")


def test_a_log_of_another_name_is_refused_before_anything_flies(tmp_path: Path) -> None:
    assert_refused(
        run("fly", "land_only", "--btlog", tmp_path / "flight.log"), "only files named *.btlog"
    )
