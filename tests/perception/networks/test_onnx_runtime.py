"""What all networks are run with: images in, finite answers out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from perception.networks.mapping import InputFormat
from perception.networks.onnx_runtime import OnnxNetwork, shrunk
from tests.perception.networks.small_networks import save
from uav_bt.errors import AnswerError, ValueRangeError, WeightsError

SAME = "y = Identity(x)"


def network(
    path: Path, wanted: InputFormat | None = None, *, class_axis: int | None = None
) -> OnnxNetwork:
    made = OnnxNetwork(path, "a test")
    made.take_images(wanted or InputFormat())
    made.compile(list(made.outputs().values()), 1, class_axis=class_axis)
    return made


@pytest.mark.parametrize(
    ("wanted", "seen"),
    [
        (InputFormat(), [30 / 255, 40 / 255, 50 / 255]),
        (InputFormat(mean=(10, 0, 0), scale=(2, 1, 4), colours="bgr"), [12.5, 40.0, 10.0]),
    ],
)
def test_colours_come_as_the_network_wants_them(
    tmp_path: Path, wanted: InputFormat, seen: list[float]
) -> None:
    rgb = np.full((8, 16, 3), (30, 40, 50), dtype=np.uint8)
    (given,) = network(save(tmp_path / "n.onnx", SAME), wanted).run(rgb)
    np.testing.assert_allclose(given[0, :, 2, 5], seen, rtol=1e-6)


def test_a_network_of_whole_numbers_gets_the_colours_as_they_are(tmp_path: Path) -> None:
    """It scales inside; divided by 255 before, every image would be black."""
    path = save(tmp_path / "n.onnx", "y = Cast <to=1> (x)", "uint8[1,3,8,16]")
    (given,) = network(path).run(np.full((8, 16, 3), 51, np.uint8))
    assert (given == 51.0).all()


def test_channels_may_come_last(tmp_path: Path) -> None:
    path = save(tmp_path / "n.onnx", SAME, "float[1,8,16,3]", "float[1,8,16,3]")
    rgb = np.full((8, 16, 3), (0, 51, 255), dtype=np.uint8)
    (given,) = network(path, InputFormat(layout="nhwc")).run(rgb)
    np.testing.assert_allclose(given[0, 2, 5], [0.0, 0.2, 1.0], rtol=1e-6)


def test_open_sizes_are_those_of_the_format_and_one_image(tmp_path: Path) -> None:
    path = save(tmp_path / "n.onnx", SAME, "float[n,3,h,w]", "float[n,3,h,w]")
    assert network(path, InputFormat(size=(16, 8))).size_px == (16, 8)


@pytest.mark.parametrize(
    ("shape", "wanted", "message"),
    [
        ("1,4,8,16", {}, "the input must be 1x3xHxW, got"),
        ("2,3,8,16", {}, "the input must be 1x3xHxW, got"),
        ("1,3,8", {}, "the input must be 1x3xHxW, got"),
        ("1,3,8,16", {"layout": "nhwc"}, "the input must be 1xHxWx3, got"),
        ("1,3,h,w", {}, r"leaves its size open; add `input: \{size: \[WIDTH, HEIGHT\]\}`"),
        ("1,3,4,8", {"size": (16, 8)}, "takes images of 8x4, the mapping says 16x8"),
    ],
)
def test_a_network_of_another_input_is_refused(
    tmp_path: Path, shape: str, wanted: dict[str, Any], message: str
) -> None:
    path = save(tmp_path / "n.onnx", SAME, f"float[{shape}]", f"float[{shape}]")
    with pytest.raises(WeightsError, match=message):
        network(path, InputFormat(**wanted))


def test_no_threads_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueRangeError, match="at least one thread"):
        OnnxNetwork(save(tmp_path / "n.onnx", SAME), "a test").compile([], 0)


def test_a_network_that_the_runtime_cannot_run_is_refused_in_one_line(tmp_path: Path) -> None:
    """OpenVINO has no plan for the largest index as a truth value."""
    nodes = "a = ArgMax <axis=1, keepdims=1> (x) y = Cast <to=9> (a)"
    with pytest.raises(WeightsError, match="OpenVINO cannot run this network") as refused:
        network(save(tmp_path / "n.onnx", nodes, given="bool[1,1,8,16]"))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("axis", [1, 3])
def test_the_best_class_is_the_one_numpy_finds(tmp_path: Path, axis: int) -> None:
    """The first of equal ones."""
    path = save(tmp_path / "n.onnx", SAME)
    rgb = np.random.default_rng(0).integers(0, 4, (8, 16, 3), dtype=np.uint8)
    (numbers,) = network(path, class_axis=axis).run(rgb)
    scores = rgb.transpose(2, 0, 1)[None]
    np.testing.assert_array_equal(numbers[:, 0], scores.argmax(axis=axis))


@pytest.mark.parametrize("axis", [None, 1])
@pytest.mark.parametrize("bad", ["y = Log(x)", "s = Sub(x, one) y = Sqrt(s)"])
def test_one_number_that_is_infinite_or_none_is_found(
    tmp_path: Path, bad: str, axis: int | None
) -> None:
    path = save(tmp_path / "n.onnx", bad, constants="float one = {0.002}")
    made = network(path, class_axis=axis)
    rgb = np.full((8, 16, 3), 90, dtype=np.uint8)
    made.run(rgb)
    rgb[3, 5, 1] = 0  # one score of one pixel, and not its best
    with pytest.raises(AnswerError, match="NaN or infinity"):
        made.run(rgb)


@pytest.mark.parametrize("size", [(224, 112), (320, 256), (256, 256), (160, 96), (500, 300)])
def test_a_smaller_image_has_the_means_of_what_it_covers(size: tuple[int, int]) -> None:
    """Sharp borders and noise, as a rendered box against a wall has."""
    rng = np.random.default_rng(1)
    rgb = np.full((360, 640, 3), 90, dtype=np.uint8)
    rgb[100:300, 200:420] = (200, 120, 40)
    rgb[150:170] = 20
    rgb = np.clip(rgb + rng.normal(0.0, 5.0, rgb.shape), 0, 255).astype(np.uint8)
    exact = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA).astype(int)
    assert np.abs(shrunk(rgb, size) - exact).mean() < 1.0


def test_images_of_the_size_stay_and_small_ones_become_larger() -> None:
    rgb = np.full((90, 160, 3), 77, dtype=np.uint8)
    assert shrunk(rgb, (160, 90)) is rgb
    larger = shrunk(rgb, (224, 112))
    assert larger.shape == (112, 224, 3)
    assert (larger == 77).all()
