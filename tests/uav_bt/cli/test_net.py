"""`uav-bt net` and the networks of labs: trained, checked, measured and used."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import Result

from sim_bridge.anafi import anafi_camera
from tests.uav_bt.learning.lab_world import (
    COLOURS,
    HEIGHT,
    WIDTH,
    draw_lab,
    exact_ids,
    write_colour_network,
)
from tests.worlds.cli import assert_refused, run
from tests.worlds.footage import frame, write_record
from uav_bt import app
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


def test_a_break_is_summed_up(views: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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


# --- networks of a lab ----------------------------------------------------------------------------


def test_training_writes_the_network_that_the_lab_is_flown_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    material = draw_lab(Path("labs/hall"), train=4)
    command = ("lab", "train", "hall", "--steps", 2, "--batch", 2)
    first = run(*command)
    assert first.exit_code == 0, first.output
    assert "warning: only 4 images for training" in first.stderr
    assert "12 held-out picks on 2 images: " in first.stdout
    assert "unchecked, because without held-out picks: cart" in first.stdout
    assert "next: uav-bt lab check labs/hall, then uav-bt fly" in first.stdout
    options = app.FlightOptions(lab="hall")
    assert options.place is not None
    assert options.place.model == str(material.network)
    again = run(*command)
    assert again.exit_code == 0, again.output
    assert f"{material.network} stays until the new network is finished" in again.stdout
    assert "loss:" not in again.stdout


def test_a_gpu_that_is_not_there_is_refused_before_anything_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    material = draw_lab(tmp_path / "hall")
    result = run("lab", "train", material.lab.folder, "--device", "cuda")
    assert_refused(result, "'cuda' needs a GPU", "train on 'cpu'")
    assert not material.training.exists()


def test_a_check_prints_scores_beside_the_teachers_and_writes_files(tmp_path: Path) -> None:
    material = draw_lab(tmp_path / "hall")
    write_colour_network(material.network, order=(2, 1, 3, 0))
    picks = material.picks.read_text()
    material.picks.write_text(picks.replace("hall-007.png,20,20", "hall-007.png,20,120"))
    out, folder = tmp_path / "scores.json", material.lab.folder
    refused = run("lab", "check", folder, "--out", material.picks)
    assert_refused(refused, "is an input and would be overwritten")
    result = run("lab", "check", folder, "--out", out, "--min-role-iou", 0.7)
    assert result.exit_code == 0, result.output
    lines = [line.split() for line in result.stdout.splitlines()]
    assert ["floor", "4", "0.800"] in lines
    assert ["cart", "0", "-"] in lines
    assert "crate taken for cart: 100 % of its picks" in result.stdout
    assert "most wrong picks: hall-007.png (3 of 6), hall-006.png (2 of 6)" in result.stdout
    sheet = cv2.imread(str(material.training / "check.png"))
    assert sheet is not None
    assert sheet.shape == (2 * 180, 3 * 320, 3)
    assert sheet[10, 320 + 5].tolist() == [0x40, 0x20, 0x20]  # BGR of the wall in the class map
    scores = json.loads(out.read_text())
    assert scores["role_iou"] == {"outside": 0.75, "ground": 0.8, "mark": None, "obstacle": 1.0}
    assert scores["confusions"] == [["crate", "cart", 1.0], ["wall", "floor", 0.25]]
    assert scores["teacher"] is None
    write_colour_network(folder / "teacher.onnx")
    with (folder / "lab.yaml").open("a") as keys:
        keys.write("teacher: {model: teacher.onnx}\n")
    result = run("lab", "check", folder)
    assert result.exit_code == 0, result.output
    assert "12 held-out picks on 2 images: 0.583 right" in result.stdout
    assert "teacher: 0.917 of the picks right, IoU of the roles 0.850" in result.stdout
    write_colour_network(tmp_path / "bad.onnx", order=(1, 2, 0, 3))
    bad = run("lab", "check", folder, "--model", tmp_path / "bad.onnx", "--min-role-iou", 0.9)
    assert bad.exit_code == 1, bad.output
    assert "the IoU of a role is 0.000, below 0.9" in bad.stderr


def test_flights_are_checked_with_or_without_picks(tmp_path: Path) -> None:
    material = draw_lab(tmp_path / "hall")
    folder, out = material.lab.folder, tmp_path / "scores.json"
    write_colour_network(material.network)
    images = [COLOURS[exact_ids(60 + 20 * index)] for index in range(3)]
    frames = [frame(image, index, float(index)) for index, image in enumerate(images)]
    camera = anafi_camera(WIDTH, HEIGHT)
    facts = {
        "lab": "hall",
        "classes": json.dumps([asdict(each) for each in material.lab.classes], default=list),
    }
    flight = write_record(tmp_path / "flight.mcap", camera, frames, [], facts=facts)
    result = run("lab", "check", folder, "--flight", flight, "--out", out)
    assert result.exit_code == 0, result.output
    assert "12 held-out picks on 2 images: 1.000 right" in result.stdout
    assert "geometry in 3 frames of flights" in result.stdout
    assert "mark: in no frame found" in result.stdout
    scores = json.loads(out.read_text())
    assert (scores["geometry"]["frames"], scores["geometry"]["size_to_height"]) == (3, None)
    material.picks.unlink()
    alone = run("lab", "check", folder, "--flight", flight)
    assert alone.exit_code == 0, alone.output
    assert "not scored: " in alone.stdout
    assert "geometry in 3 frames of flights" in alone.stdout
    refused = run("lab", "check", folder, "--flight", flight, "--min-role-iou", 0.5)
    assert_refused(refused, "there are no picks")
    other = write_record(tmp_path / "other.mcap", camera, frames, [])
    refused = run("lab", "check", folder, "--flight", other)
    assert_refused(refused, "was flown in the lab 'paper', not in 'hall'")


def test_a_lab_without_images_or_network_is_refused(tmp_path: Path) -> None:
    material = draw_lab(tmp_path / "hall")
    folder = material.lab.folder
    assert_refused(run("lab", "check", folder), "has no network: `uav-bt lab train")
    unchecked = draw_lab(tmp_path / "unchecked", check=0)
    write_colour_network(unchecked.network)
    assert_refused(run("lab", "check", unchecked.lab.folder), "no picks on images for checks")
    for image in material.frames.iterdir():
        image.unlink()
    material.frames.rmdir()
    assert_refused(run("lab", "train", folder), "there are no images of 'hall'", "lab frames")
    assert not material.network.exists()
