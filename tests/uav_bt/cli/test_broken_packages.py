"""A broken third-party package is named, and affects only its users."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.uav_bt.cli.test_root import python
from tests.worlds.cli import HOP, assert_refused, run, tree_file

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
        f"import sys\nsys.path.insert(0, {str(tmp_path)!r})\n"
        "from uav_bt.cli import main\n"
        f"sys.argv[1:] = ['fly', {str(tree_file(tmp_path, HOP))!r}, '--drone', 'plain']\n"
        "main()"
    )
    assert done.returncode == 0, done.stderr
    (warning,) = [line for line in done.stderr.splitlines() if "Warning" in line]
    assert place in warning
