"""Segmenters for flight: our networks and foreign ones."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from perception.depth.runtime import load_depth_estimator
from perception.networks.mapping import ClassMapping, InputFormat
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation import runtime
from perception.segmentation.runtime import OnnxSegmenter, RoomSegmenter, load_segmenter
from perception.segmentation.teacher import load_teacher
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views
from tests.paper_lab import CLASSES
from tests.perception.networks.small_networks import IMAGE, halves, save
from tests.perception.segmentation.patterned import samples
from tests.worlds import values
from uav_bt.errors import AnswerError, FileError, ValueRangeError, WeightsError
from uav_bt.lab.classes import GROUND, OBSTACLE, OUTSIDE
from uav_bt.lab.lab_file import read_lab
from uav_bt.lab.shipped import load_lab
from uav_bt.learning.views import DepthViewPlan
from uav_bt.protocols import Segmenter

ANY = SHIPPED_WEIGHTS / "any.onnx"
UNET = SHIPPED_WEIGHTS / "unet.onnx"
SAME = "y = Identity(x)"
LAST = "y = Transpose <perm=[0,2,3,1]> (x)"
THREE = ClassMapping(classes={0: "box_1", 1: "carpet", 2: "helipad_box"})
CARPET, HELIPAD_BOX, BOX_1, BOX_3 = 1, 3, 4, 6

# One channel: the green share of a pixel, and whether it is more than a half.
GREEN = "share = Conv(x, g)"
MORE = f"{GREEN} y = Greater(share, half)"
SHARE = f"{GREEN} y = Identity(share)"
ONE, ROOF = {0: "carpet"}, {0: "roof_1", 1: "carpet"}
CONSTANTS = "float[1,3,1,1] g = {0, 1, 0}, float half = {0.5}"

BLUE_FIRST = ClassMapping(classes=THREE.classes, input=InputFormat(colours="bgr"))
WHOLE = "m = Mul(x, many) y = Cast <to=6> (m)"
FLOATS = "a = ArgMax <axis=1> (x) y = Cast <to=1> (a)"
NUMBERS = "y = ArgMax <axis=1, keepdims=0> (x)"
REST = ClassMapping(classes={1: "carpet"}, default="box_3")
TWO = ClassMapping(classes={0: "helipad_box", 1: "carpet"})


@pytest.mark.parametrize(
    ("nodes", "ports", "mapping", "ids"),
    [
        (SAME, (IMAGE, IMAGE), THREE, (CARPET, HELIPAD_BOX)),
        (SAME, (IMAGE, IMAGE), BLUE_FIRST, (CARPET, BOX_1)),
        # Scores that come last are recognised by the aspect.
        (LAST, (IMAGE, "float[1,8,16,3]"), THREE, (CARPET, HELIPAD_BOX)),
        (WHOLE, (IMAGE, "int32[1,3,8,16]"), THREE, (CARPET, HELIPAD_BOX)),
        # Class numbers; those that the mapping does not list take the default.
        (NUMBERS, (IMAGE, "int64[1,8,16]"), REST, (CARPET, BOX_3)),
        (FLOATS, (IMAGE, "float[1,1,8,16]"), REST, (CARPET, BOX_3)),
        (MORE, (IMAGE, "bool[1,1,8,16]"), TWO, (CARPET, HELIPAD_BOX)),
    ],
    ids=["first", "bgr", "last", "whole", "numbers", "floats", "truth"],
)
def test_a_foreign_network_answers_in_our_classes(
    tmp_path: Path, nodes: str, ports: tuple[str, str], mapping: ClassMapping, ids: tuple[int, int]
) -> None:
    path = save(tmp_path / "n.onnx", nodes, *ports, f"{CONSTANTS}, float many = {{100.0}}")
    segmenter = OnnxSegmenter(path, CLASSES, mapping)
    class_map = segmenter.segment(values.frame(halves(), captured_s=2.5))
    assert isinstance(segmenter, Segmenter)
    assert (segmenter.size_px, class_map.captured_s) == ((16, 8), 2.5)
    assert class_map.ids.dtype == np.uint8
    assert class_map.ids.tolist() == [[ids[0]] * 8 + [ids[1]] * 8] * 8


def test_a_mapping_file_is_read_and_one_for_another_network_refused(tmp_path: Path) -> None:
    path = save(tmp_path / "n.onnx", SAME)
    (tmp_path / "n.yaml").write_text("classes: {0: roof_5}", encoding="utf-8")
    red = np.full((8, 16, 3), (9, 0, 0), dtype=np.uint8)
    assert (OnnxSegmenter(path, CLASSES, tmp_path / "n.yaml").ids(red) == 16).all()
    with pytest.raises(FileError, match="no such class mapping"):
        OnnxSegmenter(path, CLASSES, tmp_path / "none.yaml")
    with pytest.raises(ValueRangeError, match="names class 16, the network has classes 0 to 2"):
        OnnxSegmenter(path, CLASSES, ClassMapping.identity(CLASSES))
    with pytest.raises(WeightsError, match=r"scores of the 17 classes .* gives 3: give"):
        OnnxSegmenter(path, CLASSES)


def test_scores_in_an_unclear_place_are_refused_until_the_mapping_says_it(tmp_path: Path) -> None:
    """3x3 pixels and three classes: every axis could be any."""
    path = save(tmp_path / "n.onnx", SAME, "float[1,3,3,3]", "float[1,3,3,3]")
    with pytest.raises(WeightsError, match=r"the output 1x3x3x3 does not show .* `output: nhwc`"):
        OnnxSegmenter(path, CLASSES, THREE)
    for layout, ids in (("nchw", {CARPET}), ("nhwc", {BOX_1, CARPET, HELIPAD_BOX})):
        stated = ClassMapping(classes=THREE.classes, output=layout)
        made = OnnxSegmenter(path, CLASSES, stated).ids(halves()[:3, :3])
        assert set(made.ravel().tolist()) <= ids


def test_the_class_list_decides_where_both_places_fit(tmp_path: Path) -> None:
    """Outputs of 5x4x4 from a square image: a class 4 can only be in the axis of five."""
    nodes = "m = ReduceMean <keepdims=1> (x) z = Mul(m, zero) y = Add(z, s)"
    scores = ", ".join(["0"] * 64 + ["1"] * 16)
    constants = f"float zero = {{0.0}}, float[1,5,4,4] s = {{{scores}}}"
    path = save(tmp_path / "n.onnx", nodes, "float[1,3,2,2]", "float[1,5,4,4]", constants)
    segmenter = OnnxSegmenter(path, CLASSES, ClassMapping(classes={4: "carpet"}))
    assert segmenter.ids(halves()[:2, :2]).tolist() == [[CARPET] * 4] * 4


def test_a_network_of_another_output_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "n.onnx"
    for nodes, given, classes, message in (
        ("y = Flatten <axis=1> (x)", "float[1,384]", ONE, "xC or 1xHxW, got 1x384"),
        (SHARE, "float[1,1,8,16]", ROOF, r"must be whole numbers, and the network gives 0\.498"),
        (SHARE, "float[1,1,8,16]", ONE, "class 0, does not say .* a score for each of two classes"),
        (MORE, "bool[1,1,8,16]", ONE, "one class, class 0, does not say"),
    ):
        save(path, nodes, given=given, constants=CONSTANTS)
        with pytest.raises(WeightsError, match=message):
            OnnxSegmenter(path, CLASSES, ClassMapping(classes=classes))
    # A pixel without a class number is an error of the answer: the mission goes on without this
    # frame. For the grey image of the start all is well.
    nodes = f"{GREEN} more = Sub(share, half) y = Relu(more)"
    save(path, nodes, given="float[1,1,8,16]", constants=CONSTANTS)
    segmenter = OnnxSegmenter(path, CLASSES, ClassMapping(classes=ROOF))
    with pytest.raises(AnswerError, match=r"must be whole numbers, and the network gives 0\.284"):
        segmenter.ids(halves())


def test_the_shipped_networks_give_the_same_map_every_time() -> None:
    """The teacher flies sharp and as in the paper."""
    rgb = next(samples(1, seed=0, width=640, height=360))[1]
    frame = values.frame(rgb, captured_s=2.5)
    first, again = runtime.shipped_unet(), runtime.shipped_unet(threads=1)
    ids = first.ids(rgb)
    for segmenter in (first, again):
        np.testing.assert_array_equal(segmenter.ids(rgb), ids)
    paper = load_teacher(SHIPPED_WEIGHTS / "teacher.safetensors", CLASSES)
    for segmenter in (
        first,
        runtime.shipped_teacher(CLASSES),
        runtime.TeacherSegmenter(paper, sharp=False),
    ):
        class_map = segmenter.segment(frame)
        assert (class_map.ids.shape, class_map.captured_s) == ((112, 224), 2.5)


def test_a_network_of_a_lab_with_other_classes_is_refused() -> None:
    other = read_lab(Path(__file__).parents[2] / "labs" / "renamed").classes
    with pytest.raises(WeightsError, match=r"classes surroundings, .* states .*carpet"):
        OnnxSegmenter(UNET, other)
    with pytest.raises(WeightsError, match="expected the classes surroundings"):
        runtime.shipped_teacher(other)
    mapping = ClassMapping(classes={1: "ground", 4: "obstacle"})
    assert OnnxSegmenter(UNET, other, mapping).size_px == (224, 112)
    assert isinstance(load_segmenter(UNET, CLASSES), OnnxSegmenter)
    with pytest.raises(WeightsError, match="expected the outputs logits and depth"):
        RoomSegmenter(UNET, CLASSES)


def test_ground_and_depth_of_a_room_without_labels_are_found() -> None:
    """Depth belongs to the frame and is in heights; roles become the first classes of the lab."""
    scene = load_scene("depot-val-a")
    poses = DepthViewPlan(views=6).poses(scene, 11)
    depot = list(render_views(scene, poses, truth_size_px=(160, 128)))
    classes = load_lab("depot").classes
    segmenter, alone = load_segmenter(ANY, classes), load_depth_estimator("any")
    assert segmenter.relative_depth is None
    frame = values.frame(depot[0].image)
    np.testing.assert_array_equal(segmenter.estimate(frame).depth, alone.estimate(frame).depth)
    first = {classes.of_role(OUTSIDE)[0], classes.ground, classes.of_role(OBSTACLE)[0]}
    found = truth = both = 0
    for index, view in enumerate(depot):
        class_map = segmenter.segment(values.frame(view.image, captured_s=float(index)))
        seen, exact = class_map.roles == GROUND, classes.roles(view.ids) == GROUND
        ground = cv2.resize(exact.astype(np.uint8), segmenter.size_px, interpolation=0) > 0
        found, truth, both = found + seen.sum(), truth + ground.sum(), both + (seen & ground).sum()
        assert set(np.unique(class_map.ids).tolist()) <= first
        depth = segmenter.relative_depth
        assert (depth.captured_s, depth.metric, depth.in_heights) == (index, False, True)
        np.testing.assert_array_equal(depth.depth, alone.depth(view.image))
        predicted = cv2.resize(depth.depth, view.ids.shape[::-1], interpolation=cv2.INTER_LINEAR)
        ratio = np.median(view.depth[exact] / predicted[exact])
        assert 0.7 < ratio < 2.2, "the cameras are 0.9 to 1.7 m high"
    assert both / truth > 0.85
    assert both / found > 0.85
