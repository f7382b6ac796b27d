"""`uav-bt net perceive`: output, exit codes and refusals."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import Result

from tests.worlds.cli import assert_refused, run
from uav_bt.app.perceive.pipeline import Pipeline


def perceive(*arguments: object) -> Result:
    """Perceive without a depth network."""
    return run("net", "perceive", "--model", "contact", *arguments)


@pytest.fixture
def views(tmp_path: Path) -> Path:
    """Return a folder with a grey image, a black one, and a file that is not an image."""
    folder = tmp_path / "views"
    folder.mkdir()
    for name, value in (("1.png", 120), ("2.png", 0)):
        assert cv2.imwrite(str(folder / name), np.full((90, 160, 3), value, np.uint8))
    (folder / "3.png").write_text("no image")
    return folder


def test_a_folder_is_perceived_and_summed_up(views: Path, tmp_path: Path) -> None:
    out, lines, masks = tmp_path / "seen.mp4", tmp_path / "seen.jsonl", tmp_path / "masks"
    result = perceive(views, "--out", out, "--json", lines, "--masks", masks)
    assert result.exit_code == 0, result.output
    for words in (
        "frames          2, each for itself (--sequence: they follow one another)",
        "camera          the ANAFI's video, 69 deg wide (none given)",
        "telemetry       1.5 m above the ground, camera at -30 deg, assumed for all frames",
        "metric depth    in ",
        "none in 1: the frame is black",
        "mark            seen in 0 frames",
        "segmentation    ",
        "all             ",
        "skipped 3.png: is not a readable image",
        f"video: {out}",
        f"frames: {lines}",
        f"masks: {masks}",
    ):
        assert words in result.stdout
    assert out.stat().st_size > 0
    assert {path.name for path in masks.iterdir()} == {"1.png", "2.png", "classes.json"}
    told = [json.loads(line) for line in lines.read_text(encoding="utf-8").splitlines()]
    assert [line["image"] for line in told] == ["1.png", "2.png"]
    assert told[1]["refusal"] == "the frame is black"
    assert {"depth", "corridor", "mark", "ms"} <= told[0].keys()


def test_a_sequence_is_not_each_for_itself(views: Path) -> None:
    assert "frames          2\n" in perceive(views, "--sequence").stdout


def test_a_break_exits_with_1_and_sums_up(
    views: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    look = Pipeline.perceive

    def interrupted(pipeline: Pipeline, frame: Any, states: Any) -> Any:
        if frame.index:
            raise KeyboardInterrupt
        return look(pipeline, frame, states)

    monkeypatch.setattr(Pipeline, "perceive", interrupted)
    result = perceive(views, "--out", tmp_path / "seen.mp4")
    assert result.exit_code == 1
    assert "frames          1, then interrupted" in result.stdout
    assert (tmp_path / "seen.mp4").stat().st_size > 0
    assert "Traceback" not in result.stderr


def test_a_wrong_aspect_is_refused_with_the_cure(tmp_path: Path) -> None:
    assert cv2.imwrite(str(tmp_path / "square.png"), np.full((90, 90, 3), 99, np.uint8))
    result = perceive(tmp_path / "square.png")
    assert_refused(result, "90x90 (aspect 1.000)", "uav-bt lab calibrate", "--camera")
