"""`uav-bt fly`: exit codes, outputs, one message per mistake, and the keys of a pilot."""

from __future__ import annotations

import json
import os
import pty
import sys
import termios
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import av
import pytest

from tests.uav_bt.groot.groot_world import read_log
from tests.worlds.cli import HOP, assert_refused, run, tree_file
from tests.worlds.processes import python
from uav_bt import app
from uav_bt.cli.fly import KEYS_HELP, obey, pilot_keys
from uav_bt.errors import InputError
from uav_bt.tree import Status

SMALL = ("--image-size", "160x90", "--profile", "ideal")
PLAIN = ("--drone", "plain", "--profile", "ideal")


def test_a_mission_that_succeeds_leaves_report_and_video(tmp_path: Path) -> None:
    report, video = tmp_path / "report.json", tmp_path / "flight.mp4"
    log = tmp_path / "flight.btlog"
    outputs = ("--report", report, "--video", video, "--btlog", log)
    tree = tree_file(tmp_path, HOP)
    result = run("fly", tree, "--scene", "val-a", "--seed", 3, *SMALL, *outputs)
    assert result.exit_code == 0, result.output
    assert "success" in result.stdout
    assert f"report: {report}" in result.stdout
    assert f"video: {video}" in result.stdout
    assert f"btlog: {log}" in result.stdout
    ended = [uid for _, uid, status in read_log(log)[2] if status is Status.SUCCESS]
    assert ended == [2, 3, 1]  # take-off, landing, their sequence
    assert "take-off" in result.stderr  # the live status
    told = json.loads(report.read_text())
    assert (told["outcome"], told["scene"], told["seed"]) == ("success", "val-a", 3)
    assert (told["drone"], told["profile"]) == ("twin", "ideal")
    with av.open(str(video)) as container:
        frames = sum(1 for _ in container.decode(video=0))
    assert_refused(run("net", "perceive", video), str(video), "is a film that uav-bt made")
    assert frames >= told["ticks"]
    assert {file.name for file in tmp_path.iterdir()} == {
        "flight.btlog",
        "flight.mp4",
        "mission.xml",
        "report.json",
    }


def test_a_mission_that_fails_exits_with_1_and_still_reports(tmp_path: Path) -> None:
    body = f"<Sequence>{HOP}<AlwaysFailure/></Sequence>"
    report = tmp_path / "report.json"
    result = run("fly", tree_file(tmp_path, body), *PLAIN, "--report", report)
    assert result.exit_code == 1, result.output
    assert "aborted" in result.stdout
    told = json.loads(report.read_text())
    assert told["outcome"] == "aborted"
    assert told["scene"] == "train-a"  # the twin's default


def test_a_fault_in_a_leaf_is_one_message(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def break_down(_: object) -> None:
        raise KeyError("gimbal")

    monkeypatch.setattr("behaviours.fly.land.Land.update", break_down)
    report = tmp_path / "report.json"
    tree = tree_file(tmp_path, HOP)
    result = run("fly", tree, *PLAIN, "--report", report)
    assert result.exit_code == 1
    assert "Error: node 'Main/Sequence/Land' failed: KeyError: 'gimbal'" in result.stderr
    assert "Traceback" not in result.stderr
    assert json.loads(report.read_text())["outcome"] == "error"
    assert "Traceback" in run("--debug", "fly", tree, *PLAIN).stderr


def test_faults_are_named_by_the_summary_and_by_the_errors_that_they_raise(tmp_path: Path) -> None:
    tree = tree_file(tmp_path, HOP)
    fault = "observe-raises@take-off"
    result = run("fly", tree, "--drone", "plain", "--faults", fault)
    assert result.exit_code == 1
    assert f"the injected fault {fault} raised this error" in result.stderr
    assert "Traceback" not in result.stderr
    late = "late=0.1@take-off~0.2"
    result = run("fly", tree, "--drone", "plain", "--movers", "1", "--faults", late)
    assert late in result.stdout
    assert "1 added to those of the scene" in result.stdout


def test_options_reach_the_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[app.FlightOptions] = []

    def refuse(_tree: object, options: app.FlightOptions, **more: Any) -> None:
        asked.append(options)
        more["watch"]("the edited tree flies")
        raise InputError("enough")

    monkeypatch.setattr(app, "fly", refuse)
    words = (
        "fly land_only --scene val-b --seed 7 --drone twin:here --profile harsh --policy A/B=x "
        "--policy C=y --realtime --image-size 320x180 --threads 2 --movers 2 --quality high "
        "--time-limit 9 --faults wind=0.1@explore --exact-masks --vary-room --watch"
    )
    result = run(*words.split())
    assert_refused(result, "the edited tree flies", "enough")
    assert asked == [
        app.FlightOptions(
            scene="val-b",
            seed=7,
            drone="twin:here",
            profile="harsh",
            policies={"A/B": "x", "C": "y"},
            image_size_px=(320, 180),
            realtime=True,
            inference_threads=2,
            movers=2,
            record_quality="high",
            judge=app.JudgeConfig(time_limit_s=9.0),
            faults=["wind=0.1@explore"],
            exact_masks=True,
            vary_room=True,
        )
    ]


def test_without_opengl_it_says_what_to_install(tmp_path: Path) -> None:
    """OpenGL is chosen once per process, so a second process runs without it."""
    command = ("-m", "uav_bt", "fly", tree_file(tmp_path, HOP))
    done = python(*command, environment={"MUJOCO_GL": "off"})
    assert done.returncode == 2
    assert "MUJOCO_GL=off turns drawing off" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("option", "name", "limit_bytes", "drone", "words"),
    [
        ("--record", "flight.mcap", 20_000, PLAIN, "Error: record was lost: "),
        ("--video", "flight.mp4", 20_000, SMALL, "Error: video was lost: "),
        ("--btlog", "flight.btlog", 100, PLAIN, "flight.btlog: the log ends early"),
        ("--report", "report.json", 100, PLAIN, "Error: report was lost: "),
    ],
)
def test_a_disk_that_fills_up_hides_no_result(
    tmp_path: Path, *, option: str, name: str, limit_bytes: int, drone: tuple[str, ...], words: str
) -> None:
    """A limit of the file size does what a full disk does."""
    path, report = tmp_path / name, tmp_path / "report.json"
    code = (
        "import resource, sys; from uav_bt.cli import main; "
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({limit_bytes}, {limit_bytes})); main()"
    )
    reported = ("--report", report) if limit_bytes > 100 else ()
    done = python("-c", code, "fly", tree_file(tmp_path, HOP), *drone, option, path, *reported)
    assert done.returncode == 1, done.stderr
    assert "success" in done.stdout
    assert words in done.stderr
    assert name in done.stderr
    assert "Traceback" not in done.stderr
    if limit_bytes > 100:
        told = json.loads(report.read_text())
        assert (told["outcome"], *told["lost_outputs"]) == ("success", option.removeprefix("--"))
    if option in {"--video", "--report"}:
        assert not path.exists()
        assert f"{option.removeprefix('--')}:" not in done.stdout


def test_a_flying_drone_is_the_last_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    report = app.fly(tree_file(tmp_path, HOP), app.FlightOptions(drone="plain"))
    left = replace(report, outcome="aborted", airborne_at_end=True)

    def fly(tree: str, options: app.FlightOptions, *, listeners: list[Any], **_: object) -> object:
        flight = app.assemble(tree, options)
        for listen in listeners:
            listen(flight)
        return left

    monkeypatch.setattr(app, "fly", fly)
    result = run("fly", "land_only")
    assert result.exit_code == 1
    assert result.stderr.splitlines()[-1] == app.STILL_IN_THE_AIR


@pytest.mark.parametrize(
    ("arguments", "port"),
    [(("land_only", "--groot"), 1667), (("--groot", 2000, "land_only"), 2000)],
)
def test_groot2_is_served_on_its_port_or_another(
    arguments: tuple[str, ...], port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(**options: Any) -> None:
        raise InputError(f"enough: {options}")

    monkeypatch.setattr("uav_bt.cli.fly.watched_live", refuse)
    assert_refused(run("fly", *arguments), f"enough: {{'btlog': None, 'groot': {port}}}")


# --- keys while a mission flies: take over, hand back, land, cut the motors -----------------------


class Noted:
    """A runner that records its requests."""

    def __init__(self) -> None:
        self._manual = False
        self.asked: list[str] = []
        self.pressed = threading.Event()
        self.abort = self

    @property
    def manual(self) -> bool:
        return self._manual

    @manual.setter
    def manual(self, manual: bool) -> None:
        self._manual = manual
        self.pressed.set()

    def request(self, reason: str) -> None:
        self.asked.append(f"land: {reason}")

    def cut_motors(self, reason: str) -> None:
        self.asked.append(f"cut: {reason}")


def readers() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "keys"]


@pytest.mark.parametrize(
    ("keys", "manual", "asked"),
    [
        ("m", True, []),
        ("mm", False, []),
        ("ml", False, ["land: a person pressed l"]),  # even when a person flies
        ("X", False, ["cut: a person cut the motors"]),  # a capital only
        ("xq \n\x1b", False, []),
    ],
)
def test_each_key_has_its_own_action(keys: str, asked: list[str], *, manual: bool) -> None:
    noted = Noted()
    for key in keys:
        obey(key, noted)  # type: ignore[arg-type]
    assert (noted.manual, noted.asked) == (manual, asked)


@pytest.mark.parametrize("closed", [True, False])
def test_without_a_terminal_there_are_no_keys(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *, closed: bool
) -> None:
    """Python's `sys.stdin` is None after `uav-bt fly tree.xml <&-`."""
    with open(os.devnull, encoding="utf-8") as nothing:  # noqa: PTH123  (a device, not a path)
        monkeypatch.setattr(sys, "stdin", None if closed else nothing)
        with pilot_keys(Noted()):  # type: ignore[arg-type]
            assert readers() == []
    assert KEYS_HELP not in capsys.readouterr().err


def test_a_key_at_a_terminal_counts_and_reader_and_terminal_are_as_before(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ours, theirs = pty.openpty()
    noted = Noted()
    with os.fdopen(theirs, "r", encoding="utf-8") as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        before = termios.tcgetattr(terminal.fileno())
        with pilot_keys(noted):  # type: ignore[arg-type]
            assert termios.tcgetattr(terminal.fileno()) != before
            os.write(ours, b"m")
            assert noted.pressed.wait(30.0)
            (reader,) = readers()
        assert not reader.is_alive()
        assert termios.tcgetattr(terminal.fileno()) == before
    os.close(ours)
    assert noted.manual
    assert capsys.readouterr().err == f"{KEYS_HELP}\n"
