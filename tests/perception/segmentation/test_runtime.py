"""Segmenters for flight: our networks and foreign ones."""

from pathlib import Path

import numpy as np
import onnx
import pytest
from numpy.typing import NDArray
from onnx import TensorProto, helper

from perception.segmentation import runtime
from perception.segmentation.clean import RefineConfig
from perception.segmentation.mapping import ClassMapping, InputFormat
from tests.perception.segmentation.patterned import samples
from uav_bt.errors import FileError, UnknownNameError, ValueRangeError, WeightsError
from uav_bt.protocols import Segmenter
from uav_bt.types import Frame

FLOAT = TensorProto.FLOAT


def _frame(rgb: NDArray[np.uint8]) -> Frame:
    return Frame(image=rgb, index=1, captured_s=2.5, gimbal_pitch_rad=-0.5)


def _save(path: Path, nodes: list, shape: list, output: list, kind: int = FLOAT) -> Path:
    graph = helper.make_graph(
        nodes,
        "foreign",
        [helper.make_tensor_value_info("x", FLOAT, shape)],
        [helper.make_tensor_value_info("y", kind, output)],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.save(model, path)
    return path


def _brightest_channel(path: Path, size: tuple[int, int] = (8, 16)) -> Path:
    """A network whose class scores are the red, green and blue it is given."""
    nodes = [helper.make_node("Identity", ["x"], ["y"])]
    return _save(path, nodes, [1, 3, *size], [1, 3, *size])


THREE = ClassMapping(classes={0: 4, 1: 1, 2: 3})


def test_a_foreign_network_answers_in_our_classes(tmp_path: Path) -> None:
    segmenter = runtime.OnnxSegmenter(_brightest_channel(tmp_path / "n.onnx"), THREE)
    rgb = np.zeros((16, 32, 3), dtype=np.uint8)
    rgb[:, :16, 0] = 200
    rgb[:8, 16:, 1] = 200
    rgb[8:, 16:, 2] = 200
    class_map = segmenter.segment(_frame(rgb))
    assert isinstance(segmenter, Segmenter)
    assert segmenter.size_px == (16, 8)
    assert class_map.captured_s == 2.5
    assert class_map.ids.dtype == np.uint8
    assert (class_map.ids[:, :8] == 4).all()
    assert (class_map.ids[:4, 8:] == 1).all()
    assert (class_map.ids[4:, 8:] == 3).all()


def test_a_network_that_wants_blue_first_gets_it_there(tmp_path: Path) -> None:
    """Its first class is then the blue one; the scale can turn who is greatest."""
    wanted = InputFormat(scale=(1.0, 4.0, 1.0), colours="bgr")
    mapping = ClassMapping(classes={0: 4, 1: 1, 2: 3}, input=wanted)
    segmenter = runtime.OnnxSegmenter(_brightest_channel(tmp_path / "n.onnx"), mapping)
    rgb = np.full((8, 16, 3), (30, 90, 40), dtype=np.uint8)
    assert (segmenter.ids(rgb) == 4).all()


def test_a_channels_last_network_works(tmp_path: Path) -> None:
    nodes = [helper.make_node("Transpose", ["x"], ["y"], perm=[0, 3, 1, 2])]
    path = _save(tmp_path / "n.onnx", nodes, [1, 8, 16, 3], [1, 3, 8, 16])
    mapping = ClassMapping(classes=THREE.classes, input=InputFormat(layout="nhwc"))
    rgb = np.zeros((8, 16, 3), dtype=np.uint8)
    rgb[..., 1] = 9
    assert (runtime.OnnxSegmenter(path, mapping).ids(rgb) == 1).all()


def test_a_network_that_gives_class_numbers_works(tmp_path: Path) -> None:
    """Numbers that the mapping does not list take the default."""
    nodes = [helper.make_node("ArgMax", ["x"], ["y"], axis=1, keepdims=0)]
    path = _save(tmp_path / "n.onnx", nodes, [1, 3, 8, 16], [1, 8, 16], TensorProto.INT64)
    rgb = np.zeros((8, 16, 3), dtype=np.uint8)
    rgb[:, :8, 1] = 9
    rgb[:, 8:, 2] = 9
    ids = runtime.OnnxSegmenter(path, ClassMapping(classes={1: 1}, default=6)).ids(rgb)
    assert (ids[:, :8] == 1).all()
    assert (ids[:, 8:] == 6).all()


def test_a_mapping_file_is_read(tmp_path: Path) -> None:
    path = _brightest_channel(tmp_path / "n.onnx")
    (tmp_path / "n.yaml").write_text("classes: {0: roof_5}", encoding="utf-8")
    ids = runtime.OnnxSegmenter(path, tmp_path / "n.yaml").ids(
        np.full((8, 16, 3), (9, 0, 0), dtype=np.uint8)
    )
    assert (ids == 16).all()
    with pytest.raises(FileError, match="no such class mapping"):
        runtime.OnnxSegmenter(path, tmp_path / "none.yaml")


def test_an_open_batch_size_is_one(tmp_path: Path) -> None:
    nodes = [helper.make_node("Identity", ["x"], ["y"])]
    path = _save(tmp_path / "n.onnx", nodes, ["n", 3, 8, 16], ["n", 3, 8, 16])
    assert runtime.OnnxSegmenter(path, THREE).size_px == (16, 8)


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ([1, 4, 8, 16], "1x3xHxW of fixed size"),
        ([2, 3, 8, 16], "1x3xHxW of fixed size"),
        ([1, 3, "h", "w"], "1x3xHxW of fixed size"),
        ([1, 3, 8], "1x3xHxW of fixed size"),
    ],
)
def test_a_network_with_another_input_is_refused(tmp_path: Path, shape: list, message: str) -> None:
    nodes = [helper.make_node("Identity", ["x"], ["y"])]
    path = _save(tmp_path / "n.onnx", nodes, shape, shape)
    with pytest.raises(WeightsError, match=message):
        runtime.OnnxSegmenter(path, THREE)


def test_a_network_with_another_output_is_refused(tmp_path: Path) -> None:
    nodes = [helper.make_node("Flatten", ["x"], ["y"], axis=1)]
    path = _save(tmp_path / "n.onnx", nodes, [1, 3, 8, 16], [1, 384])
    with pytest.raises(WeightsError, match="output must be 1xCxHxW or 1xHxW"):
        runtime.OnnxSegmenter(path, THREE)


def test_a_mapping_for_another_network_is_refused(tmp_path: Path) -> None:
    path = _brightest_channel(tmp_path / "n.onnx")
    with pytest.raises(ValueRangeError, match="names class 16, the network has classes 0 to 2"):
        runtime.OnnxSegmenter(path)


def test_absent_and_damaged_networks_are_refused(tmp_path: Path) -> None:
    with pytest.raises(WeightsError, match="no such network; `uav-bt net train segmentation`"):
        runtime.OnnxSegmenter(tmp_path / "none.onnx")
    path = _brightest_channel(tmp_path / "n.onnx")
    path.write_bytes(path.read_bytes()[:60])
    with pytest.raises(WeightsError, match=r"n\.onnx: is not a readable ONNX network"):
        runtime.OnnxSegmenter(path)
    with pytest.raises(ValueRangeError, match="at least one thread"):
        runtime.shipped_unet(threads=0)


def test_an_answer_that_is_not_a_number_is_refused(tmp_path: Path) -> None:
    nodes = [helper.make_node("Log", ["x"], ["y"])]
    path = _save(tmp_path / "n.onnx", nodes, [1, 3, 8, 16], [1, 3, 8, 16])
    segmenter = runtime.OnnxSegmenter(path, THREE)
    rgb = np.full((8, 16, 3), 90, dtype=np.uint8)
    assert segmenter.ids(rgb).shape == (8, 16)
    rgb[3, 5, 1] = 0  # one score of one pixel, and not its best
    with pytest.raises(WeightsError, match="NaN or infinity"):
        segmenter.ids(rgb)


def test_the_first_of_equal_scores_is_the_class(tmp_path: Path) -> None:
    segmenter = runtime.OnnxSegmenter(_brightest_channel(tmp_path / "n.onnx"), THREE)
    rgb = np.full((8, 16, 3), (50, 90, 90), dtype=np.uint8)
    assert (segmenter.ids(rgb) == 1).all()


def test_the_shipped_unet_gives_the_same_map_every_time() -> None:
    (_, rgb, _) = next(samples(1, seed=0, width=640, height=360))
    first, again = runtime.shipped_unet(), runtime.shipped_unet(threads=1)
    ids = first.segment(_frame(rgb)).ids
    assert ids.shape == (112, 224)
    for _ in range(3):
        np.testing.assert_array_equal(first.segment(_frame(rgb)).ids, ids)
    np.testing.assert_array_equal(again.segment(_frame(rgb)).ids, ids)


@pytest.mark.parametrize("refine", [None, RefineConfig()])
def test_the_shipped_teacher_flies_plain_and_sharp(refine: RefineConfig | None) -> None:
    (_, rgb, _) = next(samples(1, seed=0, width=640, height=360))
    class_map = runtime.shipped_teacher(refine=refine).segment(_frame(rgb))
    assert class_map.ids.shape == (112, 224)
    assert class_map.captured_s == 2.5


def test_the_shipped_unets_go_by_their_names() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'unet-fp32'"):
        runtime.shipped_unet("unet-fp23")
