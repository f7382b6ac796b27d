"""Ctrl-C, SIGTERM and closed pipes at every stage: one line, exit code 1, no partial files."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import av
import pytest

from tests.uav_bt.learning.lab_world import draw_lab
from tests.worlds.cli import run, tree_file
from tests.worlds.processes import python
from tests.worlds.tables import cases
from uav_bt.record.info import record_info

HOVER = '<Sequence><TakeOff height_m="1.0"/><HoverFor seconds="250"/><Land/></Sequence>'
LONG = '<Repeat num_cycles="-1"><HoverFor seconds="1"/></Repeat>'
SMALL = "--image-size 160x90 --profile ideal"
# Announces the start of the command, which has no output at that time.
BEGIN = "import sys; from uav_bt.cli import main; print('begun', flush=True); main()"
SLOW_DRONE = """
import dataclasses, time
@dataclasses.dataclass(kw_only=True)
class Slow:
    def create(self):
        print("creating", flush=True)
        time.sleep(60)
"""
OLD = b"what was there before"


@dataclass(frozen=True, kw_only=True)
class Case:
    """An interrupted command, as tests/data/interruptions.yaml describes it."""

    line: str
    when: str
    words: str
    by: Sequence[str] = ("SIGINT",)
    code: int = 1
    after_s: float = 0.0
    kept: Sequence[str] = ()


CASES = {name: Case(**case) for name, case in cases("interruptions").items()}


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record of a flight."""
    folder = tmp_path_factory.mktemp("flown")
    tree = tree_file(folder, HOVER.replace("250", "60"))
    record = folder / "flight.mcap"
    result = run("fly", tree, "--record", record, "--quality", "high", *SMALL.split())
    assert record.is_file(), result.output
    return record


@pytest.fixture
def world(tmp_path: Path, flown: Path) -> Path:
    tree_file(tmp_path, HOVER, "hover.xml")
    tree_file(tmp_path, LONG, "long.xml")
    (tmp_path / "script.yaml").write_text("leaves: {HoverFor: RS}\n")
    (tmp_path / "flight.mcap").write_bytes(flown.read_bytes())
    for name in ("old.json", "old.mp4", "old.rrd"):
        (tmp_path / name).write_bytes(OLD)
    draw_lab(tmp_path / "labs" / "hall").network.write_bytes(OLD)
    (tmp_path / "slow.py").write_text(SLOW_DRONE)
    (tmp_path / "slow-1.dist-info").mkdir()
    (tmp_path / "slow-1.dist-info" / "METADATA").write_text("Name: slow\nVersion: 1\n")
    (tmp_path / "slow-1.dist-info" / "entry_points.txt").write_text(
        "[uav_bt.drones]\nslow = slow:Slow\n"
    )
    return tmp_path


def until(pattern: str, process: subprocess.Popen[bytes], files: tuple[Path, ...]) -> None:
    """Wait until a process has written a text or a file.

    Raises:
        AssertionError: the process ended before, or 60 s passed.
    """
    for _ in range(1200):
        said = "".join(file.read_text(errors="replace") for file in files)
        if re.search(pattern, said) or any(files[0].parent.glob(pattern)):
            return
        assert process.poll() is None, [file.read_text() for file in files]
        time.sleep(0.05)
    raise AssertionError(pattern)


@pytest.mark.parametrize("name", CASES)
def test_what_is_interrupted_says_so_and_leaves_nothing_half_done(name: str, world: Path) -> None:
    case = CASES[name]
    before = {kept: (world / kept).read_bytes() for kept in case.kept}
    stdout, stderr = world / "stdout", world / "stderr"
    path = os.pathsep.join((str(world), os.environ.get("PYTHONPATH", "")))  # it has a drone
    with stdout.open("wb") as out, stderr.open("wb") as err:
        process = subprocess.Popen(  # noqa: S603  # our own interpreter and arguments
            [sys.executable, "-c", BEGIN, *case.line.split()],
            cwd=world,
            stdout=out,
            stderr=err,
            env={**os.environ, "PYTHONPATH": path, "PYTHONUNBUFFERED": "1"},
        )
        until(case.when, process, (stdout, stderr))
        time.sleep(case.after_s)
        for each in case.by:
            process.send_signal(signal.Signals[each])
            time.sleep(0.3)
        code = process.wait(timeout=60)
    said = stdout.read_text() + stderr.read_text()
    assert "Traceback" not in said, said
    assert "unexpected" not in said, said
    assert re.search(case.words, said), said
    assert code == case.code, said
    assert {kept: (world / kept).read_bytes() for kept in case.kept} == before
    assert [file.name for file in world.rglob("*.part")] == []
    if "new.json" in case.line:
        told = json.loads((world / "new.json").read_text())
        assert (told["outcome"], told["duration_s"] < 100.0) == ("aborted", True)
        assert case.by[0] in told["reason"]
    if "new.mp4" in case.line:
        info = record_info(world / "new.mcap")
        assert info["finished"]
        assert not info["damages"]
        with av.open(str(world / "new.mp4")) as film:
            assert sum(1 for _ in film.decode(video=0)) > 5


@pytest.fixture
def closed() -> Iterator[int]:
    """A pipe whose reader is closed."""
    reader, writer = os.pipe()
    os.close(reader)
    yield writer
    os.close(writer)


@pytest.mark.parametrize(
    "line",
    [
        "tree nodes",
        "simulate long.xml --script script.yaml",
        f"fly hop.xml {SMALL} --report new.json",
    ],
)
def test_a_closed_pipe_ends_a_command_quietly(line: str, world: Path, closed: int) -> None:
    tree_file(world, '<Sequence><TakeOff height_m="1.0"/><Land/></Sequence>', "hop.xml")
    done = python("-m", "uav_bt", *line.split(), folder=world, stdout=closed)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "Error" not in done.stderr
    if "--report" in line:
        assert '"success"' in (world / "new.json").read_text()
