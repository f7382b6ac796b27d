"""What all networks are run with: images in, finite answers out."""

import itertools
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from perception.networks.mapping import InputFormat
from perception.networks.onnx_runtime import OnnxNetwork, shrunk
from tests.perception.networks.small_networks import save
from tests.worlds.tables import cases
from uav_bt.errors import AnswerError, ValueRangeError, WeightsError

SAME = "y = Identity(x)"


def network(path: Path, wanted: InputFormat | None = None, class_axis: Any = None) -> OnnxNetwork:
    made = OnnxNetwork(path, "a test")
    made.take_images(wanted or InputFormat())
    made.compile(list(made.outputs().values()), 1, class_axis=class_axis)
    return made


def test_colours_come_as_the_network_wants_them(tmp_path: Path) -> None:
    path = save(tmp_path / "n.onnx", SAME)
    changed = InputFormat(mean=(10, 0, 0), scale=(2, 1, 4), colours="bgr")
    for wanted, seen in (
        (InputFormat(), [30 / 255, 40 / 255, 50 / 255]),
        (changed, [12.5, 40.0, 10.0]),
    ):
        (given,) = network(path, wanted).run(np.full((8, 16, 3), (30, 40, 50), dtype=np.uint8))
        np.testing.assert_allclose(given[0, :, 2, 5], seen, rtol=1e-6)


def test_other_types_layouts_and_open_sizes_are_taken(tmp_path: Path) -> None:
    # A network of whole numbers scales inside; divided by 255 before, every image would be black.
    path = save(tmp_path / "n.onnx", "y = Cast <to=1> (x)", "uint8[1,3,8,16]")
    (given,) = network(path).run(np.full((8, 16, 3), 51, np.uint8))
    assert (given == 51.0).all()
    path = save(tmp_path / "n.onnx", SAME, "float[1,8,16,3]", "float[1,8,16,3]")
    rgb = np.full((8, 16, 3), (0, 51, 255), dtype=np.uint8)
    (given,) = network(path, InputFormat(layout="nhwc")).run(rgb)
    np.testing.assert_allclose(given[0, 2, 5], [0.0, 0.2, 1.0], rtol=1e-6)
    path = save(tmp_path / "n.onnx", SAME, "float[n,3,h,w]", "float[n,3,h,w]")
    assert network(path, InputFormat(size=(16, 8))).size_px == (16, 8)


@pytest.mark.parametrize(("shape", "wanted", "message"), cases("perception")["network_inputs"])
def test_another_input_is_refused(tmp_path: Path, shape: str, wanted: dict, message: str) -> None:
    path = save(tmp_path / "n.onnx", SAME, f"float[{shape}]", f"float[{shape}]")
    with pytest.raises(WeightsError, match=message):
        network(path, InputFormat(**wanted))


def test_what_the_runtime_cannot_run_is_refused_in_one_line(tmp_path: Path) -> None:
    """OpenVINO has no plan for the largest index as a truth value."""
    nodes = "a = ArgMax <axis=1, keepdims=1> (x) y = Cast <to=9> (a)"
    path = save(tmp_path / "n.onnx", nodes, given="bool[1,1,8,16]")
    with pytest.raises(WeightsError, match="OpenVINO cannot run this network") as refused:
        network(path)
    assert "\n" not in str(refused.value)
    with pytest.raises(ValueRangeError, match="at least one thread"):
        OnnxNetwork(path, "a test").compile([], 0)


def test_the_best_class_is_the_one_numpy_finds(tmp_path: Path) -> None:
    """The first of equal ones."""
    path = save(tmp_path / "n.onnx", SAME)
    rgb = np.random.default_rng(0).integers(0, 4, (8, 16, 3), dtype=np.uint8)
    for axis in (1, 3):
        (numbers,) = network(path, class_axis=axis).run(rgb)
        exact = rgb.transpose(2, 0, 1)[None].argmax(axis=axis)
        np.testing.assert_array_equal(numbers[:, 0], exact)


def test_one_number_that_is_infinite_or_none_is_found(tmp_path: Path) -> None:
    bad = ("y = Log(x)", "s = Sub(x, one) y = Sqrt(s)")
    for nodes, axis in itertools.product(bad, (None, 1)):
        path = save(tmp_path / "n.onnx", nodes, constants="float one = {0.002}")
        made, rgb = network(path, class_axis=axis), np.full((8, 16, 3), 90, dtype=np.uint8)
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
    # Images of the size stay, and small ones become larger.
    assert shrunk(rgb, (640, 360)) is rgb
    larger = shrunk(np.full((9, 16, 3), 77, dtype=np.uint8), size)
    assert larger.shape == (size[1], size[0], 3)
    assert (larger == 77).all()
