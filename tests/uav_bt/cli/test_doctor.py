"""`uav-bt doctor`: what works here; broken packages are named, and affect only their users."""

from __future__ import annotations

import importlib.metadata
import re
import socket
import sys
from pathlib import Path
from typing import NoReturn

import pytest

from sim_bridge.twin import TwinConfig
from tests.worlds.cli import HOP, assert_refused, run, tree_file
from tests.worlds.processes import python
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


def test_a_missing_extra_is_named_and_is_no_fault(monkeypatch: pytest.MonkeyPatch) -> None:
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


# --- broken packages ------------------------------------------------------------------------------

BROKEN = {
    "raises": ("x = 1\n1 / 0\n", ("broken_raises.py:2:", "ZeroDivisionError")),
    "exits": ("import sys\nsys.exit(3)\n", ("broken_exits.py:2:", "SystemExit")),
    "number": ("NODES = 3\n", ("'number'", "must name an iterable of node classes, got int")),
}
"""Source of a module by its name, and words of the messages about it."""


def install(name: str, folder: Path) -> None:
    """Install a package whose module registers something that cannot be used."""
    module = f"broken_{name}"
    (folder / f"{module}.py").write_text(BROKEN[name][0], encoding="utf-8")
    info = folder / f"{module}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        f"[uav_bt.behaviours]\n{name} = {module}:NODES\n"
        f"[uav_bt.policies]\n{name} = {module}:Policy\n"
        f"[uav_bt.drones]\n{name} = {module}:Drone\n"
    )


@pytest.mark.parametrize("name", BROKEN)
def test_only_who_needs_it_is_refused_and_the_doctor_names_it(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    install(name, tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, f"broken_{name}", raising=False)
    words = BROKEN[name][1]
    checked = run("check", "land_only")
    assert checked.exit_code == 0, checked.output
    (warning,) = caplog.messages
    assert all(word in warning for word in words), warning
    tree = tree_file(tmp_path, "<Sequence><TakePicture/></Sequence>")
    for command in ("check", "fly"):
        refused = run(command, tree)
        assert_refused(refused, "unknown node 'TakePicture'", "not loaded:", *words)
    examined = run("doctor")
    assert examined.exit_code == 1
    (line,) = (each for each in examined.stdout.split("\n") if each.startswith("behaviours:"))
    assert "NOT READY" in line
    assert "behaviours (" in line  # those of our packages
    assert all(word in examined.stdout for word in words), examined.stdout


def test_flights_on_its_drone_or_policy_are_refused_and_others_fly_with_one_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install("raises", tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    place = "broken_raises.py:2: ZeroDivisionError"
    for arguments, kind in (
        (("--drone", "raises"), "drone 'raises' (broken_raises:Drone)"),
        (("--policy", "ReturnToBase=raises"), "policy 'raises' (broken_raises:Policy)"),
    ):
        refused = run("fly", "land_only", *arguments)
        assert_refused(refused, kind, "cannot be imported", place, "'broken_raises'")
    done = python(
        "-c",
        f"import sys\nsys.path.insert(0, {str(tmp_path)!r})\n"
        "from uav_bt.cli import main\n"
        f"sys.argv[1:] = ['fly', {str(tree_file(tmp_path, HOP))!r}, '--drone', 'plain']\n"
        "main()",
    )
    assert done.returncode == 0, done.stderr
    (warning,) = [line for line in done.stderr.splitlines() if "Warning" in line]
    assert place in warning
