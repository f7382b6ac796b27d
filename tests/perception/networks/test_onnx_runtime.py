"""What all networks are run with: pictures in, class numbers out, no instruction that kills."""

import tempfile
from pathlib import Path

import cv2
import numpy as np
import pytest
from onnx import TensorProto, helper

from perception.networks import onnx_runtime as runtime

FLOAT = TensorProto.FLOAT


def _network(shape: list[int], *nodes: object) -> object:
    graph = helper.make_graph(
        list(nodes) or [helper.make_node("Identity", ["x"], ["y"])],
        "net",
        [helper.make_tensor_value_info("x", FLOAT, shape)],
        [helper.make_tensor_value_info("y", FLOAT, shape)],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "net.onnx"
        path.write_bytes(model.SerializeToString())
        return runtime.read_model(path, "a test")


# --- pictures -------------------------------------------------------------------------------------


def test_colours_are_shifted_scaled_and_ordered_as_the_network_wants() -> None:
    model = runtime.accept_uint8(
        _network([1, 3, 8, 16]), mean=(10.0, 0.0, 0.0), scale=(2.0, 1.0, 4.0), colours="bgr"
    )
    rgb = np.full((1, 8, 16, 3), (30, 40, 50), dtype=np.uint8)
    seen = runtime.compile_model(model, 1, Path("net.onnx"))(rgb)[0]
    assert seen.shape == (1, 3, 8, 16)
    assert seen[0, :, 2, 5].tolist() == [12.5, 40.0, 10.0]


def test_a_channels_last_network_gets_its_channels_last() -> None:
    model = runtime.accept_uint8(_network([1, 8, 16, 3]), planar=False)
    rgb = np.full((1, 8, 16, 3), (0, 51, 255), dtype=np.uint8)
    seen = runtime.compile_model(model, 1, Path("net.onnx"))(rgb)[0]
    np.testing.assert_allclose(seen[0, 2, 5], [0.0, 0.2, 1.0], rtol=1e-6)


@pytest.mark.parametrize("size", [(224, 112), (320, 256), (256, 256), (160, 96), (500, 300)])
def test_a_smaller_picture_shows_the_means_of_what_it_covers(size: tuple[int, int]) -> None:
    """Sharp borders and noise, as a rendered box against a wall has."""
    rng = np.random.default_rng(1)
    rgb = np.full((360, 640, 3), 90, dtype=np.uint8)
    rgb[100:300, 200:420] = (200, 120, 40)
    rgb[150:170] = 20
    rgb = np.clip(rgb + rng.normal(0.0, 5.0, rgb.shape), 0, 255).astype(np.uint8)
    exact = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA).astype(int)
    off = np.abs(runtime.shrunk(rgb, size) - exact)
    assert off.mean() < 1.0


def test_a_picture_of_the_right_size_is_left_alone() -> None:
    rgb = np.zeros((12, 20, 3), dtype=np.uint8)
    assert runtime.shrunk(rgb, (20, 12)) is rgb


def test_a_small_picture_is_made_larger() -> None:
    rgb = np.full((90, 160, 3), 77, dtype=np.uint8)
    larger = runtime.shrunk(rgb, (224, 112))
    assert larger.shape == (112, 224, 3)
    assert (larger == 77).all()


# --- class numbers --------------------------------------------------------------------------------


def _numbers(scores: np.ndarray) -> tuple[np.ndarray, bool]:
    network = runtime.compile_model(
        runtime.class_numbers(_network(list(scores.shape))), 1, Path("net.onnx")
    )
    best, sound = network(scores).values()
    return best, bool(sound)


def test_the_best_class_is_the_one_numpy_finds() -> None:
    scores = np.random.default_rng(0).normal(size=(1, 17, 12, 20)).astype(np.float32)
    best, sound = _numbers(scores)
    np.testing.assert_array_equal(best[0, 0], scores[0].argmax(axis=0))
    assert sound


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_one_score_that_is_no_number_is_detected(bad: float) -> None:
    scores = np.random.default_rng(0).normal(size=(1, 17, 12, 20)).astype(np.float32)
    scores[0, 9, 3, 4] = bad
    assert not _numbers(scores)[1]
