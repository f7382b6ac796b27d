"""Depth estimators for flight: our network's stand-ins and foreign ones."""

from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import helper

from perception.depth import runtime
from tests.perception.networks.small_networks import IMAGE, save
from uav_bt.errors import AnswerError, WeightsError
from uav_bt.protocols import DepthEstimator
from uav_bt.types import Frame

RED = "float[1,3,1,1] w = {1, 0, 0}, float p = {%s}, int64[1] one = {1}"
"""Constants: the red of a pixel, and what is added to it."""


def _red(path: Path, *, plus: float = 0.0, rank: int = 4, mapping: str = "output: depth") -> Path:
    """A network that says the red it sees, from 0 to 1, plus a number."""
    last = "Identity(s)" if rank == 4 else "Squeeze(s, one)"
    given = "float[1,1,8,16]" if rank == 4 else "float[1,8,16]"
    nodes = f"r = Conv(x, w) s = Add(r, p) y = {last}"
    return _save(path, nodes, given=given, plus=plus, mapping=mapping)


def _save(
    path: Path,
    nodes: str,
    taken: str = IMAGE,
    given: str = IMAGE,
    *,
    plus: float = 0.0,
    mapping: str = "output: depth",
) -> Path:
    if mapping:
        path.with_suffix(".yaml").write_text(mapping, encoding="utf-8")
    return save(path, nodes, taken, given, RED % plus)


RGB = np.zeros((16, 32, 3), dtype=np.uint8)  # the left half is red, the right half less
RGB[..., 0] = np.where(np.arange(32) < 16, 255, 51)


@pytest.mark.parametrize("rank", [3, 4])
def test_a_foreign_network_says_relative_depth(tmp_path: Path, rank: int) -> None:
    estimator = runtime.OnnxDepthEstimator(_red(tmp_path / "n.onnx", rank=rank, plus=0.1))
    assert isinstance(estimator, DepthEstimator)
    assert estimator.size_px == (16, 8)
    depth = estimator.estimate(Frame(image=RGB, index=1, captured_s=2.5, gimbal_pitch_rad=-0.5))
    assert (depth.metric, depth.captured_s) == (False, 2.5)
    assert depth.depth.dtype == np.float32
    np.testing.assert_allclose(depth.depth[:, :8], 1.1, rtol=1e-5)
    np.testing.assert_allclose(depth.depth[:, 8:], 0.3, rtol=1e-5)


def test_a_disparity_is_turned_over_and_nought_is_far_away(tmp_path: Path) -> None:
    path = _red(tmp_path / "n.onnx", mapping="output: disparity")
    estimator = runtime.OnnxDepthEstimator(path)
    rgb = RGB.copy()
    rgb[:, :8, 0] = 0
    depth = estimator.depth(rgb)
    np.testing.assert_allclose(depth[:, :4], 1e4)
    np.testing.assert_allclose(depth[:, 4:8], 1.0, rtol=1e-5)
    np.testing.assert_allclose(depth[:, 8:], 5.0, rtol=1e-5)


def test_the_next_frame_leaves_the_last_depth_alone(tmp_path: Path) -> None:
    estimator = runtime.OnnxDepthEstimator(_red(tmp_path / "n.onnx", plus=0.1))
    first = estimator.depth(RGB)
    kept = first.copy()
    estimator.depth(255 - RGB)
    np.testing.assert_array_equal(first, kept)


@pytest.mark.parametrize(
    ("nodes", "message"),
    [
        ("r = Conv(x, w) y = Add(r, p)", "a depth must be positive, and one is not"),
        ("r = Conv(x, w) y = Log(r)", "NaN or infinity"),
    ],
)
def test_an_answer_that_is_no_depth_is_refused(tmp_path: Path, nodes: str, message: str) -> None:
    path = _save(tmp_path / "n.onnx", nodes, given="float[1,1,8,16]", plus=-0.5)
    with pytest.raises(AnswerError, match=message):
        runtime.OnnxDepthEstimator(path).depth(0 * RGB)


@pytest.mark.parametrize(
    ("nodes", "given", "message"),
    [
        ("y = Identity(x)", IMAGE, "the output must be 1x1xHxW"),
        ("r = Conv(x, w) y = Flatten <axis=1> (r)", "float[1,128]", "the output must be 1x1xHxW"),
        (
            "r = Conv(x, w) y = Concat <axis=3> (r, r)",
            "float[1,1,8,32]",
            "not be larger than the input 16x8, got 32x8",
        ),
    ],
)
def test_an_output_that_is_no_depth_map_is_refused(
    tmp_path: Path, nodes: str, given: str, message: str
) -> None:
    path = _save(tmp_path / "n.onnx", nodes, given=given)
    with pytest.raises(WeightsError, match=message):
        runtime.OnnxDepthEstimator(path)


def test_a_network_without_a_mapping_may_give_depth_or_disparity_and_is_refused(
    tmp_path: Path,
) -> None:
    path = _red(tmp_path / "n.onnx", mapping="")
    with pytest.raises(WeightsError, match=r"`output: disparity` into .*n\.yaml"):
        runtime.load_depth_estimator(path)


def test_a_network_that_this_package_exported_gives_depth(tmp_path: Path) -> None:
    path = _red(tmp_path / "n.onnx", plus=0.1, mapping="")
    model = onnx.load(path)
    helper.set_model_props(model, {"weights_sha256": "0" * 64})
    onnx.save(model, path)
    assert runtime.load_depth_estimator(path).depth(RGB)[0, 0] == pytest.approx(1.1)


def test_the_mapping_says_how_the_image_is_wanted(tmp_path: Path) -> None:
    """Blue is first, colours are from 0 to 255, and the file leaves the size open."""
    mapping = "output: depth\ninput: {scale: [1, 1, 1], colours: bgr, size: [16, 8]}\n"
    size = "float[n,3,h,w]", "float[n,1,h,w]"
    path = _save(tmp_path / "n.onnx", "y = Conv(x, w)", *size, mapping=mapping)
    estimator = runtime.OnnxDepthEstimator(path)
    assert estimator.size_px == (16, 8)
    rgb = np.full((16, 32, 3), (10, 20, 30), np.uint8)
    np.testing.assert_allclose(estimator.depth(rgb), 30.0)
