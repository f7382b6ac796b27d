"""`uav-bt lab frames`: images of a lab from videos."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.uav_bt.learning.frames_world import view, walk, write_video
from tests.worlds.cli import assert_refused, run


@pytest.fixture
def hall(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    assert run("lab", "new", "hall").exit_code == 0
    return tmp_path / "labs" / "hall"


def test_the_summary_counts_images_by_source(hall: Path) -> None:
    write_video(Path("walk.mp4"), walk(10))
    result = run("lab", "frames", "hall", "walk.mp4", "--count", 8)
    assert result.exit_code == 0, result.output
    heading, line, last = result.stdout.splitlines()
    assert heading.split()[:2] == ["source", "read"]
    assert line.split() == ["walk.mp4", "10", "0", "0", "2", "8", "2"]
    assert last == "images: 8 in labs/hall/frames"
    assert "Warning: 8 images are few for a network, 40 are the least" in result.stderr
    assert len(list((hall / "frames").glob("*.jpg"))) == 8

    again = run("lab", "frames", "hall", "walk.mp4")
    assert "taken in an earlier run" in again.stdout
    assert "images: 8" in again.stdout


def test_a_source_without_images_is_refused_after_the_others(hall: Path) -> None:
    write_video(Path("walk.mp4"), walk(4))
    write_video(Path("still.mp4"), [view(0)] * 4)
    result = run("lab", "frames", hall, "still.mp4", "walk.mp4")
    assert result.exit_code == 2
    assert "images: 4" in result.stdout
    assert "Error: still.mp4: all its images look alike" in result.stderr
    assert_refused(run("lab", "frames", hall, "still.mp4"), "still.mp4: all its images look alike")
