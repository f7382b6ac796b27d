"""`uav-bt doctor`, `serve-anafi`, and the options of `uav-bt fly` for real drones."""

from __future__ import annotations

import importlib.metadata
import re
import socket
from pathlib import Path
from typing import NoReturn

import pytest

from sim_bridge.twin import TwinConfig
from tests.worlds.cli import HOP, assert_refused, run, tree_file
from uav_bt.errors import MissingDependencyError


def test_the_doctor_tells_what_works_and_sends_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        pytest.fail("a packet was sent")

    for name in ("connect", "sendto"):
        monkeypatch.setattr(socket.socket, name, refuse)
    result = run("doctor")
    assert result.exit_code == 0, result.output
    whole = result.stdout.replace("\n  ", " ").splitlines()
    lines = dict(line.split(": ", maxsplit=1) for line in whole)
    assert lines["Python"].startswith("ok, 3.")
    assert "mujoco" in lines["needed packages"]
    assert re.search(r"\d+ cores, (no )?VNNI.*; \d+\.\d GB free in this folder", lines["machine"])
    assert lines["drawing the lab"] == "ok, OpenGL works"
    assert lines["behaviours"].startswith("ok, behaviours (")
    assert lines["drones"] == "ok, anafi, plain, sphinx, twin"
    assert "extra dev" not in lines


def test_a_missing_extra_is_named_with_its_pip_line_and_is_no_fault(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    version = importlib.metadata.version

    def absent(name: str) -> str:
        if name in {"pyzmq", "rerun-sdk"}:
            raise importlib.metadata.PackageNotFoundError(name)
        return version(name)

    monkeypatch.setattr(importlib.metadata, "version", absent)
    result = run("doctor")
    assert result.exit_code == 0, result.output
    msgpack = version("msgpack")
    assert (
        f"extra live: optional, not installed: pyzmq (installed: msgpack=={msgpack}); "
        'run `pip install -c constraints.txt -e ".[live]"` in the folder of uav-bt\'s source\n'
    ) in result.stdout
    assert "extra view: optional, not installed: rerun-sdk; run `pip " in result.stdout


def test_a_failed_drawing_is_reported_and_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    def create(_: TwinConfig) -> NoReturn:
        raise MissingDependencyError("no OpenGL: install uav-bt[osmesa]")

    monkeypatch.setattr(TwinConfig, "create", create)
    result = run("doctor")
    assert result.exit_code == 1
    faults = [line for line in result.stdout.splitlines() if "NOT READY" in line]
    assert faults == ["drawing the lab: NOT READY, no OpenGL: install uav-bt[osmesa]"]


def test_the_doctor_looks_at_a_drone_when_asked() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    result = run("doctor", "--drone", f"anafi:127.0.0.1:{port}")
    assert result.exit_code in (1, 2)  # without Parrot's SDK its error comes first
    assert "Parrot's SDK" in result.stderr or "cannot reach anafi" in result.stderr


def test_a_rehearsal_succeeds_without_leaving_the_ground(tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    drone = ("--image-size", "160x90", "--profile", "ideal", "--rehearse")
    result = run("fly", tree_file(tmp_path, HOP), *drone, "--report", report)
    assert result.exit_code == 0, result.output
    orders = [line for line in result.stdout.splitlines() if "would be sent: " in line]
    assert [line.partition("sent: ")[2] for line in orders[:1]] == ["take off"]
    assert any(line.endswith("land") for line in orders)
    assert "success" in result.stdout


def test_a_taken_port_exits_with_2_and_says_what_to_do() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        free = [f"--{name}-port=0" for name in ("discovery", "commands", "http", "rtsp")]
        result = run("serve-anafi", "--no-video", *free, "--control-port", port)
    assert_refused(result, f"the control port {port} of 127.0.0.1 is taken", "choose another port")
