"""Segmenters for flight: our networks and foreign ones."""

from pathlib import Path

import numpy as np
import onnx
import pytest
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from perception.networks.input_format import InputFormat
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation import runtime
from perception.segmentation.clean import RefineConfig
from perception.segmentation.mapping import ClassMapping
from tests.paper_lab import CLASSES
from tests.perception.segmentation.patterned import samples
from uav_bt.errors import AnswerError, FileError, ValueRangeError, WeightsError
from uav_bt.lab.lab_file import read_lab
from uav_bt.protocols import Segmenter
from uav_bt.types import Frame

FLOAT = TensorProto.FLOAT


def _frame(rgb: NDArray[np.uint8]) -> Frame:
    return Frame(image=rgb, index=1, captured_s=2.5, gimbal_pitch_rad=-0.5)


def _save(
    path: Path,
    nodes: list,
    shape: list,
    output: list,
    kind: int = FLOAT,
    *,
    taken: int = FLOAT,
    constants: dict | None = None,
) -> Path:
    graph = helper.make_graph(
        nodes,
        "foreign",
        [helper.make_tensor_value_info("x", taken, shape)],
        [helper.make_tensor_value_info("y", kind, output)],
        [
            numpy_helper.from_array(np.asarray(value), name)
            for name, value in (constants or {}).items()
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.save(model, path)
    return path


def _brightest_channel(path: Path, size: tuple[int, int] = (8, 16)) -> Path:
    """A network whose class scores are the red, green and blue it is given."""
    nodes = [helper.make_node("Identity", ["x"], ["y"])]
    return _save(path, nodes, [1, 3, *size], [1, 3, *size])


THREE = ClassMapping(classes={0: "box_1", 1: "carpet", 2: "helipad_box"})


def test_a_foreign_network_answers_in_our_classes(tmp_path: Path) -> None:
    segmenter = runtime.OnnxSegmenter(_brightest_channel(tmp_path / "n.onnx"), CLASSES, THREE)
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
    mapping = ClassMapping(classes={0: "box_1", 1: "carpet", 2: "helipad_box"}, input=wanted)
    segmenter = runtime.OnnxSegmenter(_brightest_channel(tmp_path / "n.onnx"), CLASSES, mapping)
    rgb = np.full((8, 16, 3), (30, 90, 40), dtype=np.uint8)
    assert (segmenter.ids(rgb) == 4).all()


def test_a_channels_last_network_works(tmp_path: Path) -> None:
    nodes = [helper.make_node("Transpose", ["x"], ["y"], perm=[0, 3, 1, 2])]
    path = _save(tmp_path / "n.onnx", nodes, [1, 8, 16, 3], [1, 3, 8, 16])
    mapping = ClassMapping(classes=THREE.classes, input=InputFormat(layout="nhwc"))
    rgb = np.zeros((8, 16, 3), dtype=np.uint8)
    rgb[..., 1] = 9
    assert (runtime.OnnxSegmenter(path, CLASSES, mapping).ids(rgb) == 1).all()


def test_a_network_that_gives_class_numbers_works(tmp_path: Path) -> None:
    """Numbers that the mapping does not list take the default."""
    nodes = [helper.make_node("ArgMax", ["x"], ["y"], axis=1, keepdims=0)]
    path = _save(tmp_path / "n.onnx", nodes, [1, 3, 8, 16], [1, 8, 16], TensorProto.INT64)
    rgb = np.zeros((8, 16, 3), dtype=np.uint8)
    rgb[:, :8, 1] = 9
    rgb[:, 8:, 2] = 9
    ids = runtime.OnnxSegmenter(
        path, CLASSES, ClassMapping(classes={1: "carpet"}, default="box_3")
    ).ids(rgb)
    assert (ids[:, :8] == 1).all()
    assert (ids[:, 8:] == 6).all()


def test_a_mapping_file_is_read(tmp_path: Path) -> None:
    path = _brightest_channel(tmp_path / "n.onnx")
    (tmp_path / "n.yaml").write_text("classes: {0: roof_5}", encoding="utf-8")
    ids = runtime.OnnxSegmenter(path, CLASSES, tmp_path / "n.yaml").ids(
        np.full((8, 16, 3), (9, 0, 0), dtype=np.uint8)
    )
    assert (ids == 16).all()
    with pytest.raises(FileError, match="no such class mapping"):
        runtime.OnnxSegmenter(path, CLASSES, tmp_path / "none.yaml")


def test_an_open_batch_size_is_one(tmp_path: Path) -> None:
    nodes = [helper.make_node("Identity", ["x"], ["y"])]
    path = _save(tmp_path / "n.onnx", nodes, ["n", 3, 8, 16], ["n", 3, 8, 16])
    assert runtime.OnnxSegmenter(path, CLASSES, THREE).size_px == (16, 8)


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ([1, 4, 8, 16], "the input must be 1x3xHxW, got"),
        ([2, 3, 8, 16], "the input must be 1x3xHxW, got"),
        ([1, 3, "h", "w"], r"leaves its size open; add `input: \{size: \[WIDTH, HEIGHT\]\}`"),
        ([1, 3, 8], "the input must be 1x3xHxW, got"),
    ],
)
def test_a_network_with_another_input_is_refused(tmp_path: Path, shape: list, message: str) -> None:
    nodes = [helper.make_node("Identity", ["x"], ["y"])]
    path = _save(tmp_path / "n.onnx", nodes, shape, shape)
    with pytest.raises(WeightsError, match=message):
        runtime.OnnxSegmenter(path, CLASSES, THREE)


def test_a_network_with_another_output_is_refused(tmp_path: Path) -> None:
    nodes = [helper.make_node("Flatten", ["x"], ["y"], axis=1)]
    path = _save(tmp_path / "n.onnx", nodes, [1, 3, 8, 16], [1, 384])
    with pytest.raises(WeightsError, match="output must be 1xCxHxW, 1xHxWxC or 1xHxW, got 1x384"):
        runtime.OnnxSegmenter(path, CLASSES, THREE)


def test_a_mapping_for_another_network_is_refused(tmp_path: Path) -> None:
    path = _brightest_channel(tmp_path / "n.onnx")
    with pytest.raises(ValueRangeError, match="names class 16, the network has classes 0 to 2"):
        runtime.OnnxSegmenter(path, CLASSES, ClassMapping.identity(CLASSES))
    with pytest.raises(WeightsError, match=r"scores of the 17 classes .* gives 3: give"):
        runtime.OnnxSegmenter(path, CLASSES)


def _halves() -> NDArray[np.uint8]:
    """Return an image of 16x8 pixels: the left half green, the right half blue."""
    rgb = np.zeros((8, 16, 3), dtype=np.uint8)
    rgb[:, :8, 1] = 200
    rgb[:, 8:, 2] = 200
    return rgb


def _one_channel(path: Path, *after: object, kind: int = FLOAT) -> Path:
    """A network of one channel: the green share of a pixel, then what comes after it."""
    green = np.array([0.0, 1.0, 0.0], np.float32).reshape(1, 3, 1, 1)
    nodes = [helper.make_node("Conv", ["x", "g"], ["share"]), *after]
    constants = {"g": green, "half": np.float32(0.5), "axis": np.array([1])}
    return _save(path, nodes, [1, 3, 8, 16], [1, 1, 8, 16], kind, constants=constants)


def test_scores_that_come_last_are_recognised_by_the_aspect(tmp_path: Path) -> None:
    nodes = [helper.make_node("Transpose", ["x"], ["y"], perm=[0, 2, 3, 1])]
    path = _save(tmp_path / "n.onnx", nodes, [1, 3, 8, 16], [1, 8, 16, 3])
    ids = runtime.OnnxSegmenter(path, CLASSES, THREE).ids(_halves())
    assert ids.shape == (8, 16)
    assert (ids[:, :8] == 1).all()
    assert (ids[:, 8:] == 3).all()


def test_scores_in_an_unclear_place_are_refused_until_the_mapping_says_it(tmp_path: Path) -> None:
    """3x3 pixels and three classes: every axis could be any."""
    nodes = [helper.make_node("Identity", ["x"], ["y"])]
    path = _save(tmp_path / "n.onnx", nodes, [1, 3, 3, 3], [1, 3, 3, 3])
    with pytest.raises(WeightsError, match=r"the output 1x3x3x3 does not show .* `output: nhwc`"):
        runtime.OnnxSegmenter(path, CLASSES, THREE)
    stated = ClassMapping(classes=THREE.classes, output="nchw")
    assert (runtime.OnnxSegmenter(path, CLASSES, stated).ids(_halves()[:3, :3]) == 1).all()


def test_the_class_list_decides_where_both_places_fit(tmp_path: Path) -> None:
    """Outputs of 5x4x4 from a square image: a class 4 can only be in the axis of five."""
    classes, pixels = 5, 4
    scores = np.zeros((1, classes, pixels, pixels), np.float32)
    scores[:, 4] = 1.0
    nodes = [
        helper.make_node("ReduceMean", ["x"], ["m"], keepdims=1),
        helper.make_node("Mul", ["m", "zero"], ["z"]),
        helper.make_node("Add", ["z", "scores"], ["y"]),
    ]
    path = _save(
        tmp_path / "n.onnx",
        nodes,
        [1, 3, 2, 2],
        list(scores.shape),
        constants={"zero": np.float32(0.0), "scores": scores},
    )
    ids = runtime.OnnxSegmenter(path, CLASSES, ClassMapping(classes={4: "carpet"})).ids(
        _halves()[:2, :2]
    )
    assert ids.tolist() == [[1] * pixels] * pixels


def test_one_class_is_a_threshold_and_the_rest_is_the_default(tmp_path: Path) -> None:
    path = _one_channel(tmp_path / "n.onnx", helper.make_node("Identity", ["share"], ["y"]))
    ids = runtime.OnnxSegmenter(
        path, CLASSES, ClassMapping(classes={0: "carpet"}, default="box_1")
    ).ids(_halves())
    assert (ids[:, :8] == 1).all()  # 200/255 is more than a half
    assert (ids[:, 8:] == 4).all()


def test_scores_of_one_class_want_a_threshold(tmp_path: Path) -> None:
    doubled = helper.make_node("Div", ["share", "half"], ["y"])
    path = _one_channel(tmp_path / "n.onnx", doubled)
    segmenter = runtime.OnnxSegmenter(path, CLASSES, ClassMapping(classes={0: "carpet"}))
    with pytest.raises(WeightsError, match=r"within 0 and 1, got 0 to 1\.57.*`threshold: 0`"):
        segmenter.ids(_halves())
    stated = ClassMapping(classes={0: "carpet"}, default="box_1", threshold=1.0)
    ids = runtime.OnnxSegmenter(path, CLASSES, stated).ids(_halves())
    assert (ids[:, :8] == 1).all()
    assert (ids[:, 8:] == 4).all()
    with pytest.raises(WeightsError, match="the network is not one of one class"):
        runtime.OnnxSegmenter(
            _brightest_channel(tmp_path / "n.onnx"),
            CLASSES,
            ClassMapping(classes=THREE.classes, threshold=0.5),
        )


def test_shares_are_no_class_numbers(tmp_path: Path) -> None:
    path = _one_channel(tmp_path / "n.onnx", helper.make_node("Identity", ["share"], ["y"]))
    with pytest.raises(WeightsError, match=r"must be whole numbers, and the network gives 0\.498"):
        runtime.OnnxSegmenter(path, CLASSES, ClassMapping(classes={0: "background", 1: "carpet"}))


@pytest.mark.parametrize(
    ("classes", "inside", "outside"),
    [({0: "carpet"}, 1, 4), ({0: "helipad_box", 1: "carpet"}, 1, 3)],
    ids=["one", "numbers"],
)
def test_a_mask_of_truth_values_is_taken(
    tmp_path: Path, classes: dict[int, str], inside: int, outside: int
) -> None:
    greater = helper.make_node("Greater", ["share", "half"], ["y"])
    path = _one_channel(tmp_path / "n.onnx", greater, kind=TensorProto.BOOL)
    ids = runtime.OnnxSegmenter(path, CLASSES, ClassMapping(classes=classes, default="box_1")).ids(
        _halves()
    )
    assert (ids[:, :8] == inside).all()
    assert (ids[:, 8:] == outside).all()


def test_a_network_that_the_runtime_cannot_run_is_refused_in_one_line(tmp_path: Path) -> None:
    """OpenVINO has no plan for the largest index as a truth value."""
    nodes = [
        helper.make_node("ArgMax", ["x"], ["a"], axis=1, keepdims=1),
        helper.make_node("Cast", ["a"], ["y"], to=TensorProto.BOOL),
    ]
    path = _save(tmp_path / "n.onnx", nodes, [1, 3, 8, 16], [1, 1, 8, 16], TensorProto.BOOL)
    with pytest.raises(WeightsError, match="OpenVINO cannot run this network") as refused:
        runtime.OnnxSegmenter(path, CLASSES, ClassMapping(classes={0: "background", 1: "carpet"}))
    assert "\n" not in str(refused.value)


def test_an_open_size_is_the_mappings(tmp_path: Path) -> None:
    nodes = [helper.make_node("Identity", ["x"], ["y"])]
    path = _save(tmp_path / "n.onnx", nodes, ["n", 3, "h", "w"], ["n", 3, "h", "w"])
    mapping = ClassMapping(classes=THREE.classes, input=InputFormat(size=(16, 8)))
    segmenter = runtime.OnnxSegmenter(path, CLASSES, mapping)
    assert segmenter.size_px == (16, 8)
    assert (segmenter.ids(_halves())[:, :8] == 1).all()
    fixed = _brightest_channel(tmp_path / "fixed.onnx", (4, 8))
    with pytest.raises(WeightsError, match="takes images of 8x4, the mapping says 16x8"):
        runtime.OnnxSegmenter(fixed, CLASSES, mapping)


def test_a_network_of_whole_numbers_gets_the_colours_as_they_are(tmp_path: Path) -> None:
    """It scales inside; divided by 255 before, every image would be black."""
    nodes = [helper.make_node("Cast", ["x"], ["y"], to=FLOAT)]
    path = _save(tmp_path / "n.onnx", nodes, [1, 3, 8, 16], [1, 3, 8, 16], taken=TensorProto.UINT8)
    ids = runtime.OnnxSegmenter(path, CLASSES, THREE).ids(_halves())
    assert (ids[:, :8] == 1).all()
    assert (ids[:, 8:] == 3).all()


def test_scores_in_whole_numbers_are_scores(tmp_path: Path) -> None:
    nodes = [
        helper.make_node("Mul", ["x", "many"], ["m"]),
        helper.make_node("Cast", ["m"], ["y"], to=TensorProto.INT32),
    ]
    path = _save(
        tmp_path / "n.onnx",
        nodes,
        [1, 3, 8, 16],
        [1, 3, 8, 16],
        TensorProto.INT32,
        constants={"many": np.float32(100.0)},
    )
    ids = runtime.OnnxSegmenter(path, CLASSES, THREE).ids(_halves())
    assert (ids[:, :8] == 1).all()
    assert (ids[:, 8:] == 3).all()


def test_no_threads_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="at least one thread"):
        runtime.shipped_unet(threads=0)


def test_an_answer_that_is_not_a_number_is_refused(tmp_path: Path) -> None:
    nodes = [helper.make_node("Log", ["x"], ["y"])]
    path = _save(tmp_path / "n.onnx", nodes, [1, 3, 8, 16], [1, 3, 8, 16])
    segmenter = runtime.OnnxSegmenter(path, CLASSES, THREE)
    rgb = np.full((8, 16, 3), 90, dtype=np.uint8)
    assert segmenter.ids(rgb).shape == (8, 16)
    rgb[3, 5, 1] = 0  # one score of one pixel, and not its best
    with pytest.raises(AnswerError, match="NaN or infinity"):
        segmenter.ids(rgb)


def test_the_first_of_equal_scores_is_the_class(tmp_path: Path) -> None:
    segmenter = runtime.OnnxSegmenter(_brightest_channel(tmp_path / "n.onnx"), CLASSES, THREE)
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
    class_map = runtime.shipped_teacher(CLASSES, refine=refine).segment(_frame(rgb))
    assert class_map.ids.shape == (112, 224)
    assert class_map.captured_s == 2.5


def test_a_network_of_a_lab_with_other_classes_is_refused(tmp_path: Path) -> None:
    other = read_lab(Path(__file__).parents[2] / "labs" / "renamed").classes
    path = SHIPPED_WEIGHTS / "unet.onnx"
    with pytest.raises(WeightsError, match=r"classes surroundings, .* states .*carpet"):
        runtime.OnnxSegmenter(path, other)
    with pytest.raises(WeightsError, match="expected the classes surroundings"):
        runtime.shipped_teacher(other)
    mapping = ClassMapping(classes={1: "ground", 4: "obstacle"})
    assert runtime.OnnxSegmenter(path, other, mapping).size_px == (224, 112)
