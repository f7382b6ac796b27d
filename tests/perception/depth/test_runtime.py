"""Depth estimators for flight: our network's stand-ins and foreign ones."""

from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from perception.depth import runtime
from uav_bt.errors import FileError, ValueRangeError, WeightsError
from uav_bt.protocols import DepthEstimator
from uav_bt.types import Frame

FLOAT = TensorProto.FLOAT


def _save(
    path: Path, nodes: list, output: list, constants: dict, shape: tuple = (1, 3, 8, 16)
) -> Path:
    graph = helper.make_graph(
        nodes,
        "foreign",
        [helper.make_tensor_value_info("x", FLOAT, shape)],
        [helper.make_tensor_value_info("y", FLOAT, output)],
        [numpy_helper.from_array(np.asarray(value), name) for name, value in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.save(model, path)
    path.with_suffix(".yaml").write_text("output: depth\n", encoding="utf-8")
    return path


def _disparity(path: Path) -> Path:
    path.with_suffix(".yaml").write_text("output: disparity\n", encoding="utf-8")
    return path


def _red(path: Path, *, plus: float = 0.0, rank: int = 4) -> Path:
    """A network that says the red it sees, from 0 to 1, plus a number."""
    red = np.zeros((1, 3, 1, 1), np.float32)
    red[0, 0] = 1.0
    nodes = [
        helper.make_node("Conv", ["x", "w"], ["r"]),
        helper.make_node("Add", ["r", "p"], ["s"]),
        helper.make_node("Identity", ["s"], ["y"])
        if rank == 4
        else helper.make_node("Squeeze", ["s", "one"], ["y"]),
    ]
    constants = {"w": red, "p": np.float32(plus), "one": np.array([1], np.int64)}
    return _save(path, nodes, [1, 1, 8, 16] if rank == 4 else [1, 8, 16], constants)


def _frame(rgb: np.ndarray) -> Frame:
    return Frame(image=rgb, index=1, captured_s=2.5, gimbal_pitch_rad=-0.5)


def _halves() -> np.ndarray:
    rgb = np.zeros((16, 32, 3), dtype=np.uint8)
    rgb[:, :16, 0] = 255
    rgb[:, 16:, 0] = 51
    return rgb


@pytest.mark.parametrize("rank", [3, 4])
def test_a_foreign_network_says_relative_depth(tmp_path: Path, rank: int) -> None:
    estimator = runtime.OnnxDepthEstimator(_red(tmp_path / "n.onnx", rank=rank, plus=0.1))
    assert isinstance(estimator, DepthEstimator)
    assert estimator.size_px == (16, 8)
    depth = estimator.estimate(_frame(_halves()))
    assert (depth.metric, depth.captured_s) == (False, 2.5)
    assert depth.depth.dtype == np.float32
    np.testing.assert_allclose(depth.depth[:, :8], 1.1, rtol=1e-5)
    np.testing.assert_allclose(depth.depth[:, 8:], 0.3, rtol=1e-5)


def test_a_disparity_is_turned_over_and_nought_is_far_away(tmp_path: Path) -> None:
    estimator = runtime.OnnxDepthEstimator(_disparity(_red(tmp_path / "n.onnx")))
    rgb = _halves()
    rgb[:, :8, 0] = 0
    depth = estimator.depth(rgb)
    np.testing.assert_allclose(depth[:, :4], 1e4)
    np.testing.assert_allclose(depth[:, 4:8], 1.0, rtol=1e-5)
    np.testing.assert_allclose(depth[:, 8:], 5.0, rtol=1e-5)


def test_the_next_frame_leaves_the_last_depth_alone(tmp_path: Path) -> None:
    estimator = runtime.OnnxDepthEstimator(_red(tmp_path / "n.onnx", plus=0.1))
    first = estimator.depth(_halves())
    kept = first.copy()
    estimator.depth(255 - _halves())
    np.testing.assert_array_equal(first, kept)


def test_two_threads_say_the_same(tmp_path: Path) -> None:
    path = _red(tmp_path / "n.onnx", plus=0.1)
    one, two = (runtime.OnnxDepthEstimator(path, threads=n).depth(_halves()) for n in (1, 2))
    np.testing.assert_allclose(one, two, rtol=1e-6)


def test_a_depth_that_is_not_positive_is_refused(tmp_path: Path) -> None:
    estimator = runtime.OnnxDepthEstimator(_red(tmp_path / "n.onnx", plus=-0.5))
    with pytest.raises(WeightsError, match=r"a depth must be positive, got -0\.3$"):
        estimator.estimate(_frame(_halves()))


def test_an_answer_that_is_no_number_is_refused(tmp_path: Path) -> None:
    nodes = [
        helper.make_node("Conv", ["x", "w"], ["r"]),
        helper.make_node("Log", ["r"], ["y"]),
    ]
    weights = np.full((1, 3, 1, 1), -1.0, np.float32)
    path = _save(tmp_path / "n.onnx", nodes, [1, 1, 8, 16], {"w": weights})
    estimator = runtime.OnnxDepthEstimator(path)
    with pytest.raises(WeightsError, match="NaN or infinity"):
        estimator.depth(_halves())


def test_a_network_with_several_outputs_a_pixel_is_no_depth_network(tmp_path: Path) -> None:
    path = _save(
        tmp_path / "n.onnx", [helper.make_node("Identity", ["x"], ["y"])], [1, 3, 8, 16], {}
    )
    with pytest.raises(WeightsError, match="the output must be 1x1xHxW"):
        runtime.OnnxDepthEstimator(path)


def test_a_network_of_another_input_is_refused(tmp_path: Path) -> None:
    path = _save(
        tmp_path / "n.onnx",
        [helper.make_node("Identity", ["x"], ["y"])],
        [1, 1, 8, 16],
        {},
        shape=(1, 1, 8, 16),
    )
    with pytest.raises(WeightsError, match="the input must be 1x3xHxW, got"):
        runtime.OnnxDepthEstimator(path)


def test_the_earlier_name_of_contact_says_the_new_one() -> None:
    with pytest.raises(ValueRangeError, match="'footing' is called 'contact' now"):
        runtime.load_depth_estimator("footing")


def test_no_threads_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueRangeError, match="at least one thread"):
        runtime.OnnxDepthEstimator(_red(tmp_path / "n.onnx"), threads=0)


def test_a_network_without_a_mapping_may_give_depth_or_disparity_and_is_refused(
    tmp_path: Path,
) -> None:
    path = _red(tmp_path / "n.onnx")
    path.with_suffix(".yaml").unlink()
    with pytest.raises(WeightsError, match=r"`output: disparity` into .*n\.yaml"):
        runtime.load_depth_estimator(path)


def test_a_network_that_this_package_exported_gives_depth(tmp_path: Path) -> None:
    path = _red(tmp_path / "n.onnx", plus=0.1)
    path.with_suffix(".yaml").unlink()
    model = onnx.load(path)
    helper.set_model_props(model, {"weights_sha256": "0" * 64})
    onnx.save(model, path)
    assert runtime.load_depth_estimator(path).depth(_halves())[0, 0] == pytest.approx(1.1)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("output: disparit", "n.yaml:1: output: expected 'depth' or 'disparity', got 'disparit'"),
        ("input: {}", "n.yaml:1: lacks the key 'output'"),
    ],
)
def test_a_malformed_mapping_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = _red(tmp_path / "n.onnx")
    path.with_suffix(".yaml").write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match=message):
        runtime.load_depth_estimator(path)


def test_the_mapping_says_how_the_image_is_wanted(tmp_path: Path) -> None:
    """Blue is first, colours are from 0 to 255, and the file leaves the size open."""
    red = np.zeros((1, 3, 1, 1), np.float32)
    red[0, 0] = 1.0
    nodes = [helper.make_node("Conv", ["x", "w"], ["y"])]
    path = _save(
        tmp_path / "n.onnx", nodes, ["n", 1, "h", "w"], {"w": red}, shape=("n", 3, "h", "w")
    )
    path.with_suffix(".yaml").write_text(
        "output: depth\ninput: {scale: [1, 1, 1], colours: bgr, size: [16, 8]}\n",
        encoding="utf-8",
    )
    estimator = runtime.OnnxDepthEstimator(path)
    assert estimator.size_px == (16, 8)
    rgb = np.full((16, 32, 3), (10, 20, 30), np.uint8)
    np.testing.assert_allclose(estimator.depth(rgb), 30.0)
