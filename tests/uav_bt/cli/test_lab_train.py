"""`uav-bt lab train` and `lab check`: output, files and refusals."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import cv2
import pytest
import torch

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
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    material = draw_lab(tmp_path / "hall")
    result = run("lab", "train", material.lab.folder, "--device", "cuda")
    assert_refused(result, "'cuda' needs a GPU", "train on 'cpu'")
    assert not material.training.exists()


def test_a_check_prints_scores_beside_the_teachers_and_writes_sheet_and_json(
    tmp_path: Path,
) -> None:
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
