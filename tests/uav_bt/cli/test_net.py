"""`uav-bt net evaluate depth` and `net perceive`: output, files, exit codes and refusals."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import Result

from tests.worlds.cli import run
from uav_bt.app.perceive.pipeline import Pipeline
from uav_bt.cli.evaluate import depth_table

ONE_SCENE = ("--scene", "train-b", "--views", 3)


def test_ground_contact_is_measured_beside_the_paper(tmp_path: Path) -> None:
    out = tmp_path / "depth.json"
    result = run("net", "evaluate", "depth", "--model", "contact", *ONE_SCENE, "--out", out)
    assert result.exit_code == 0, result.output
    assert "contact on 3 images of train-b, unet masks, telemetry of profile 'lab'" in result.stdout
    paper, contact = result.stdout.splitlines()[3:5]
    figures = ["0.0740", "0.0597", "0.0988", "0.0655", "0.8342", "0.1440", "0.1628", "0.3714"]
    assert paper.split() == ["the", "paper", "(adaptive)", *figures]
    assert contact.split()[0] == "contact"
    written = json.loads(out.read_text())
    assert (written["model"], written["images"]) == ("contact", 3)
    (row,) = written["rows"]
    assert row["distances"]["total"] == written["points"] > 50
    assert row["edges"]["total"] == written["edges"] > 3
    assert row["edges"]["mean_m"] < 0.05
    assert row["edges"]["rmse_m"] ** 2 == pytest.approx(
        row["edges"]["mean_m"] ** 2 + row["edges"]["std_m"] ** 2, abs=1e-4
    )


def test_every_method_has_a_row_on_exact_masks() -> None:
    result = run("net", "evaluate", "depth", "--masks", "exact", *ONE_SCENE)
    assert result.exit_code == 0, result.output
    assert "exact masks" in result.stdout
    rows = [line.split()[0] for line in result.stdout.splitlines()[4:]]
    assert rows == ["constant", "least_squares", "adaptive", "flown", "contact"]


def test_figures_that_nobody_knows_are_dashes() -> None:
    names = ("mean_m", "median_m", "rmse_m", "std_m", "max_m", "correlation")
    error = dict.fromkeys(names) | {"total": 0, "valid": 0}
    row = {"method": "contact", "edges": error, "distances": error, "obstacles": error}
    heads, _, contact = depth_table([row]).splitlines()
    assert contact.split() == ["contact", *"------------"]
    assert len(heads) == len(contact), "numbers are aligned at the right"


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
