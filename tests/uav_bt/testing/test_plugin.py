"""The pytest plug-in: its fixtures work in a foreign project."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

FOREIGN = '''
from uav_bt.tree import Leaf, Status
from uav_bt.types import Command, TakeOff


class Wait(Leaf):
    """Waits."""

    def update(self):
        return Status.RUNNING if self.clock.now() < 1.0 else Status.SUCCESS


def test_bench(leaf_bench):
    bench = leaf_bench(Wait)
    assert bench.tick() is Status.RUNNING
    assert bench.tick(advance_s=1.0) is Status.SUCCESS


def test_drone(scripted_drone, manual_clock):
    assert scripted_drone.clock is manual_clock
    scripted_drone.send(Command(movement=TakeOff()))
    assert scripted_drone.commands
'''


def test_fixtures_in_a_foreign_project(tmp_path: Path) -> None:
    """Two tests that use nothing but the fixtures pass, with a fresh pytest."""
    (tmp_path / "test_foreign.py").write_text(FOREIGN, encoding="utf-8")
    root = Path(__file__).parents[3]
    command = [sys.executable, "-m", "pytest", "-q", "-p", "uav_bt.testing.plugin"]
    done = subprocess.run(  # noqa: S603  # our own interpreter and arguments
        [*command, "--rootdir", str(tmp_path), str(tmp_path)],
        capture_output=True,
        text=True,
        cwd=root,
        check=False,
    )
    assert "2 passed" in done.stdout, done.stdout + done.stderr
