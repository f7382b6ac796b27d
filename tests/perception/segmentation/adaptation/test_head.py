"""The linear head: fitted, folded into a network, and stated for one place."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation.adaptation.head import (
    GroundHead,
    HeadConfig,
    agreement,
    fit_head,
)
from perception.segmentation.adaptation.learned_lab import (
    AdaptedSegmenter,
    LearnedPlace,
    network_hash,
    write_learned_lab,
)
from perception.segmentation.adaptation.place_statement import PlaceStatement
from perception.segmentation.adaptation.role_network import (
    OnnxRoleNetwork,
    RoleView,
    classes_by_role,
)
from perception.segmentation.geometry.labels import GROUND, NOT_GROUND, GroundLabels
from perception.segmentation.room_runtime import RoomSegmenter
from perception.segmentation.runtime import OnnxSegmenter, load_segmenter
from perception.segmentation.training.unet import UNET_FILES
from tests.paper_lab import CLASSES
from tests.perception.segmentation.adaptation.learned_world import STATEMENT
from uav_bt.errors import FileError, InputError, ShapeError
from uav_bt.testing.drone import pinhole
from uav_bt.types import Attitude, Frame
from uav_bt.types.arrays import Image

CHANNELS = 4


def _room(seed: int = 0, *, blind: bool = True) -> tuple[RoleView, GroundLabels]:
    """Return a view whose second channel shows ground, and labels of it."""
    generator = np.random.default_rng(seed)
    features = generator.normal(0.0, 1.0, (CHANNELS, 56, 112)).astype(np.float32)
    features[1, 28:] += 6.0
    ground = np.zeros((112, 224), bool)
    ground[56:] = True
    scores = np.zeros((3, 112, 224), np.float32)
    scores[0] = 1.0  # all is outside
    if not blind:
        scores[1] = np.where(ground, 4.0, -4.0)
    labels = np.where(ground, GROUND, NOT_GROUND).astype(np.uint8)
    sure = np.ones(labels.shape, np.float32)
    return RoleView(scores=scores, features=features), GroundLabels(
        frame=seed, labels=labels, confidence=sure
    )


def test_a_head_learns_what_its_network_does_not_know() -> None:
    views, labels = zip(*(_room(seed) for seed in range(3)), strict=True)
    head = fit_head(views, labels)
    other, true = _room(9)
    assert agreement(GroundHead.unchanged(CHANNELS), [other], [true]) == pytest.approx(0.5)
    assert agreement(head, [other], [true]) > 0.97
    assert np.argmax(np.abs(head.weights)) == 1


def test_a_network_that_agrees_is_left_as_it_is() -> None:
    views, labels = zip(*(_room(seed, blind=False) for seed in range(2)), strict=True)
    head, view = fit_head(views, labels), views[0]
    assert not head.weights.any()
    np.testing.assert_array_equal(head.scores(view).argmax(axis=0), view.scores.argmax(axis=0))


def test_too_few_labels_are_refused() -> None:
    view, labels = _room()
    few = replace(labels, labels=np.where(labels.labels == GROUND, 0, labels.labels).astype("u1"))
    with pytest.raises(InputError, match="shows too little to learn from: 0 pixels of ground"):
        fit_head([view], [few], HeadConfig())


def test_features_of_another_network_are_refused() -> None:
    view, _ = _room()
    with pytest.raises(ShapeError, match="features of the adapted network must be 7xhxw"):
        GroundHead.unchanged(7).scores(view)


def test_classes_count_by_their_role() -> None:
    groups = classes_by_role(CLASSES.names, CLASSES)
    assert groups[1] == [CLASSES.names.index("carpet")]
    assert CLASSES.names.index("helipad_h") in groups[2]
    assert classes_by_role(["outside", "ground", "obstacle"], None) == [[0], [1], [2]]


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> OnnxRoleNetwork:
    path = tmp_path_factory.mktemp("floats") / "unet.onnx"
    UNET_FILES.export(SHIPPED_WEIGHTS / "unet.safetensors", path)
    return OnnxRoleNetwork(path, CLASSES)


@pytest.fixture(scope="module")
def image() -> Image:
    noise = np.random.default_rng(1).integers(0, 255, (23, 40, 3), dtype=np.uint8)
    return np.kron(noise, np.ones((16, 16, 1), np.uint8))[:360, :640]


def _place(network: OnnxRoleNetwork, image: Image) -> LearnedPlace:
    generator = np.random.default_rng(2)
    features = network.infer(image).features
    spread = features.reshape(len(features), -1).std(axis=1)
    head = GroundHead(weights=generator.normal(0.0, 1.0, 24), margin_weight=0.3, bias=0.4)
    statement = replace(
        STATEMENT,
        base=network_hash(network.path),
        feature_means=(tuple(features.reshape(len(features), -1).mean(axis=1).tolist()),),
        feature_spread=tuple(spread.tolist()),
    )
    return LearnedPlace(head=head, statement=statement, labels=())


def test_the_folded_network_decides_as_the_head(
    network: OnnxRoleNetwork, image: Image, tmp_path: Path
) -> None:
    place = _place(network, image)
    lab = write_learned_lab(tmp_path / "hall", place, network)
    assert lab.classes.names == ("outside", "ground", "obstacle")
    path = Path(lab.network["model"])
    flown = OnnxSegmenter(path, lab.classes)
    ids = flown.ids(image)
    expected = place.head.scores(network.infer(image)).argmax(axis=0)
    assert len(np.unique(expected)) > 1
    assert np.mean(ids == expected) > 0.999
    np.testing.assert_array_equal(
        OnnxRoleNetwork(path).infer(image).features, network.infer(image).features
    )
    assert PlaceStatement.read(lab.folder) == place.statement
    with pytest.raises(FileError, match="exists: choose another name"):
        write_learned_lab(tmp_path / "hall", place, network)


def test_a_lab_needs_a_name(network: OnnxRoleNetwork, image: Image, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the name of a lab consists of"):
        write_learned_lab(tmp_path / "My Hall", _place(network, image), network)


def test_another_place_camera_or_height_is_noticed(network: OnnxRoleNetwork, image: Image) -> None:
    statement = _place(network, image).statement
    camera = replace(
        pinhole(), width_px=448, height_px=224, fx_px=326.0, fy_px=289.7, cx_px=223.5, cy_px=111.5
    )
    same = [network.infer(image)]
    assert statement.foreign(1.5, same) is None
    assert "1.5 m above the ground, not 2.5 m" in (statement.foreign(2.5, same) or "")
    assert "above the ground" in (statement.foreign(float("nan"), same) or "")
    night = [network.infer(np.zeros_like(image))]
    assert "differ from those of the learned place" in (statement.foreign(1.5, night) or "")
    assert statement.foreign_camera(camera.resized(1280, 640)) is None
    assert "sees 69 x 42 degrees, and this one sees 73 x 42" in (
        statement.foreign_camera(replace(camera, fx_px=300.0)) or ""
    )
    squarer = replace(camera, height_px=280, cy_px=139.5)  # the same focal lengths, another aspect
    assert statement.foreign_camera(squarer) is not None


def _frame() -> Frame:
    return Frame(
        image=np.zeros((360, 640, 3), np.uint8),
        index=0,
        captured_s=0.0,
        gimbal_pitch_rad=-0.5,
        attitude=Attitude(),
        altitude_m=1.0,
        height_m=1.5,
        height_above_ground_m=1.5,
    )


def test_the_adapted_segmenter_speaks_the_classes_of_the_flights_lab() -> None:
    view, _ = _room()

    class Fake:
        def infer(self, rgb: Image) -> RoleView:
            assert rgb.ndim == 3
            return view

    weights = np.zeros(CHANNELS)
    weights[1] = 1.0
    head = GroundHead(weights=weights, margin_weight=0.0, bias=-3.0)
    class_map = AdaptedSegmenter(Fake(), head, CLASSES).segment(_frame())
    assert class_map.is_ground[70:].mean() > 0.9
    assert class_map.is_ground[:40].mean() < 0.1


def test_the_metadata_names_the_classes(
    network: OnnxRoleNetwork, image: Image, tmp_path: Path
) -> None:
    import onnx  # noqa: PLC0415 - only here

    lab = write_learned_lab(tmp_path / "hall", _place(network, image), network)
    model = onnx.load(str(lab.network["model"]))
    stated = {each.key: each.value for each in model.metadata_props}
    assert json.loads(stated["classes"]) == ["outside", "ground", "obstacle"]
    assert stated["adapted_from"] == network_hash(network.path)


ANY = SHIPPED_WEIGHTS / "any.onnx"


def test_an_adapted_network_of_two_heads_keeps_its_depth(image: Image, tmp_path: Path) -> None:
    network = OnnxRoleNetwork(ANY)
    place = _place(network, image)
    lab = write_learned_lab(tmp_path / "hall", place, network)
    path = Path(lab.network["model"])
    adapted, base = OnnxRoleNetwork(path).infer(image), network.infer(image)
    np.testing.assert_array_equal(adapted.features, base.features)
    assert adapted.depth is not None
    np.testing.assert_array_equal(adapted.depth, base.depth)
    flown = load_segmenter(path, lab.classes)
    assert isinstance(flown, RoomSegmenter)
    in_flight = AdaptedSegmenter(network, place.head, lab.classes)
    frame = replace(_frame(), image=image)
    assert np.mean(flown.segment(frame).ids == in_flight.segment(frame).ids) > 0.999
    for segmenter in (flown, in_flight):
        depth = segmenter.relative_depth
        assert depth is not None
        assert (depth.in_heights, depth.captured_s) == (True, frame.captured_s)
        np.testing.assert_array_equal(depth.depth, base.depth)


def test_a_head_that_fits_chance_is_not_taken() -> None:
    """Labels without a pattern are followed on the frames themselves only."""
    views, labels = zip(*(_room(seed, blind=False) for seed in range(4)), strict=True)
    generator = np.random.default_rng(5)
    chance = [
        replace(each, labels=generator.choice([GROUND, NOT_GROUND], each.labels.shape).astype("u1"))
        for each in labels
    ]
    assert not fit_head(views, chance, HeadConfig(strength=100.0)).is_new
