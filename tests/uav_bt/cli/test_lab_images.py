"""`uav-bt lab frames` and `lab pick`: images of a lab from videos, and picks on them."""

from __future__ import annotations

import os
import shutil
import socket
from http.server import HTTPServer
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.uav_bt.learning.frames_world import view, walk, write_video
from tests.worlds.cli import assert_refused, run
from uav_bt.lab.shipped import write_lab

PICKS = """\
image,x,y,class,origin
0.png,1,1,floor,hand
0.png,2,2,floor,hand
1.png,3,3,pad,hand
"""


@pytest.fixture
def hall(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A lab with five images, of which the last is for the check; serving ends at once."""
    monkeypatch.chdir(tmp_path)
    folder = write_lab("hall", Path("labs")).parent
    (folder / "frames").mkdir()
    for number in range(5):
        cv2.imwrite(str(folder / "frames" / f"{number}.png"), np.zeros((9, 16, 3), dtype=np.uint8))

    def stopped(_: HTTPServer) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(HTTPServer, "serve_forever", stopped)
    return folder


def test_without_picks_it_counts_none_of_each_class_and_names_the_next_command(hall: Path) -> None:
    result = run("lab", "pick", "hall")
    assert result.exit_code == 0, result.output
    assert "open http://127.0.0.1:" in result.stdout
    none = "outside 0, floor 0, pad 0, obstacle 0"
    assert f"0 picks: {hall / 'picks.csv'} ({none})\n" in result.stdout
    assert "images with picks: 0 for training, 0 for the check" in result.stdout
    assert result.stdout.endswith("next: uav-bt lab train hall\n")
    assert not (hall / "picks.csv").exists()


def test_it_sums_up_the_picks(hall: Path) -> None:
    (hall / "picks.csv").write_text(PICKS, encoding="utf-8")
    result = run("lab", "pick", hall)
    assert (
        f"3 picks: {hall / 'picks.csv'} (outside 0, floor 2, pad 1, obstacle 0)\n" in result.stdout
    )
    assert "images with picks: 2 for training, 0 for the check" in result.stdout
    (hall / "picks.csv").write_text(PICKS.replace("1.png", "4.png"), encoding="utf-8")
    result = run("lab", "pick", hall)
    assert "images with picks: 1 for training, 1 for the check" in result.stdout


def test_a_malformed_picks_file_is_refused_and_kept(hall: Path) -> None:
    (hall / "picks.csv").write_text("image,x,y\n", encoding="utf-8")
    assert_refused(run("lab", "pick", "hall"), "picks.csv:1: the columns must be image,x,y,class")
    assert (hall / "picks.csv").read_text(encoding="utf-8") == "image,x,y\n"


def test_a_port_that_is_taken_is_refused(hall: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        refused = run("lab", "pick", "hall", "--port", port)
    assert_refused(refused, f"port {port} cannot be served", "give another --port")


@pytest.mark.skipif(os.geteuid() == 0, reason="the administrator may write anywhere")
def test_a_folder_that_cannot_be_written_to_is_refused(hall: Path) -> None:
    hall.chmod(0o500)
    try:
        assert_refused(run("lab", "pick", "hall"), "cannot be written")
    finally:
        hall.chmod(0o700)


def test_the_summary_counts_images_by_source(hall: Path) -> None:
    shutil.rmtree(hall / "frames")
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
    shutil.rmtree(hall / "frames")
    write_video(Path("walk.mp4"), walk(4))
    write_video(Path("still.mp4"), [view(0)] * 4)
    result = run("lab", "frames", hall, "still.mp4", "walk.mp4")
    assert result.exit_code == 2
    assert "images: 4" in result.stdout
    assert "Error: still.mp4: all its images look alike" in result.stderr
    assert_refused(run("lab", "frames", hall, "still.mp4"), "still.mp4: all its images look alike")
