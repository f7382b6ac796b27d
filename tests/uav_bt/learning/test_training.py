"""Shipped networks on images of the twin, export, and a short training of depth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from perception.control.ego_state import state_size
from perception.control.runtime import OnnxControlStudent
from perception.depth.runtime import load_depth_estimator
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation.runtime import OnnxSegmenter, shipped_unet
from sim_bridge.anafi import anafi_camera
from tests.paper_lab import CLASSES
from tests.worlds.cli import assert_refused, run
from tests.worlds.footage import SeesGround, frame, state, write_record
from uav_bt.learning.dataset import read_flights
from uav_bt.learning.views import TRAINING_SCENES, VALIDATION_SCENES, ViewPlan, twin_views


@pytest.fixture(scope="module")
def floats(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Export the shipped weights in floats; return the folder."""
    from perception.control.training.network import STUDENT_FILES
    from perception.depth.training.network import DEPTH_FILES
    from perception.segmentation.training.unet import UNET_FILES

    folder = tmp_path_factory.mktemp("floats")
    for name, files in (("unet", UNET_FILES), ("depth", DEPTH_FILES), ("student", STUDENT_FILES)):
        files.export(SHIPPED_WEIGHTS / f"{name}.safetensors", folder / f"{name}.onnx")
    return folder


@pytest.fixture(scope="module")
def pictures() -> list[np.ndarray]:
    """Return images that were not used for training or calibration."""
    plan = ViewPlan(scenes=VALIDATION_SCENES, views=8, size_px=(640, 360), truth_size_px=(32, 18))
    return [rgb for _, rgb, _ in twin_views(plan)]


def test_networks_in_integers_answer_as_in_floats(floats: Path, pictures: list[np.ndarray]) -> None:
    unet, exact = shipped_unet(), OnnxSegmenter(floats / "unet.onnx", CLASSES)
    agreeing = np.array([(unet.ids(rgb) == exact.ids(rgb)).mean() for rgb in pictures])
    assert agreeing.mean() > 0.999
    assert agreeing.min() > 0.99
    off = depth_errors(SHIPPED_WEIGHTS / "depth.onnx", floats, pictures)
    assert off.mean() < 0.01
    assert np.quantile(off, 0.99) < 0.04
    said = []
    for folder in (SHIPPED_WEIGHTS, floats):
        student = OnnxControlStudent(folder / "student.onnx")
        numbers = np.zeros(state_size(student.config.views), dtype=np.float32)
        views = [[student.preprocess(rgb)] * student.config.views for rgb in pictures]
        answers = [student.estimate(one, numbers) for one in views]
        said.append([(answer.advance, answer.step_m) for answer in answers])
    off = np.abs(np.array(said[0]) - np.array(said[1]))
    assert off.mean() < 0.03
    assert off.max() < 0.25


def depth_errors(file: Path, floats: Path, pictures: list[np.ndarray]) -> np.ndarray:
    """Return relative differences of a depth network and the one in floats."""
    mine, exact = load_depth_estimator(file), load_depth_estimator(floats / "depth.onnx")
    return np.stack([np.abs(mine.depth(rgb) / exact.depth(rgb) - 1.0) for rgb in pictures])


def test_a_network_is_calibrated_on_the_pictures_of_the_plan(
    tmp_path: Path, floats: Path, pictures: list[np.ndarray]
) -> None:
    """A few images of one scene suffice, and the same images always give the same file."""
    from uav_bt.learning.training import CALIBRATION_VIEWS, export_network

    assert set(CALIBRATION_VIEWS.scenes) == set(TRAINING_SCENES)
    plan = replace(CALIBRATION_VIEWS, scenes=("train-a",), views=4)
    told: list[tuple[str, int, int]] = []
    for name in ("one.onnx", "two.onnx"):
        export_network(
            "depth",
            SHIPPED_WEIGHTS / "depth.safetensors",
            tmp_path / name,
            views=plan,
            advance=lambda *now: told.append(now),
        )
    assert told[:4] == [("calibration", done, 4) for done in range(1, 5)]
    assert (tmp_path / "one.onnx").read_bytes() == (tmp_path / "two.onnx").read_bytes()
    assert np.median(depth_errors(tmp_path / "one.onnx", floats, pictures[:4])) < 0.03
    absent = replace(plan, scenes=("no such scene",))  # floats need no pictures
    source = SHIPPED_WEIGHTS / "depth.safetensors"
    export_network("depth", source, tmp_path / "floats.onnx", precision="fp32", views=absent)
    assert (tmp_path / "floats.onnx").read_bytes() == (floats / "depth.onnx").read_bytes()


def test_the_command_writes_a_network_from_weights_of_its_kind(tmp_path: Path) -> None:
    out = tmp_path / "net.onnx"
    words = ("net", "export", "depth", "--out", out, "--scene", "train-a", "--views", 1)
    refused = run(*words, "--weights", SHIPPED_WEIGHTS / "unet.safetensors")
    assert_refused(refused, "expected weights of kind 'depth-network'")
    assert not out.exists()
    result = run(*words)
    assert result.exit_code == 0, result.output
    assert f"network in int8: {out}, 1.1 MB" in result.output
    assert load_depth_estimator(out).size_px == (320, 256)


COUNT = 6


@pytest.fixture
def film(tmp_path: Path) -> Path:
    """Return a record of stripes, which is quick to make."""
    frames = []
    for place in range(COUNT):
        image = np.zeros((180, 320, 3), np.uint8)
        image[:, 4 * place :: 16] = 200
        frames.append(frame(image, place, 0.1 * place))
    states = [state(one.captured_s) for one in frames]
    return write_record(tmp_path / "stripes.mcap", anafi_camera(320, 180), frames, states)


def test_labels_are_made_once_and_kept(film: Path, tmp_path: Path) -> None:
    segmenter = SeesGround(first_row=40)
    (first,) = read_flights([film], segmenter, tmp_path / "run")
    (again,) = read_flights([film], segmenter, tmp_path / "run")
    assert segmenter.asked == COUNT
    assert first.labels is not None
    assert again.labels is not None
    np.testing.assert_array_equal(first.labels, again.labels)
    assert np.isfinite(first.labels[::3, 0, 100]).all()
    assert read_flights([film], None, tmp_path)[0].labels is None


def test_the_command_trains_on_a_record(film: Path, tmp_path: Path) -> None:
    out, kept = tmp_path / "mine.safetensors", tmp_path / "run"
    words = ("--out", out, "--run", kept, "--no-photometric", "--steps", 1)
    result = run("net", "train", "depth", film, *words)
    assert result.exit_code == 0, result.output
    assert f"depth network: {out} and {out.with_suffix('.onnx')}" in result.output
    estimator = load_depth_estimator(out.with_suffix(".onnx"))
    assert estimator.depth(np.zeros((360, 640, 3), np.uint8)).shape == (128, 160)
