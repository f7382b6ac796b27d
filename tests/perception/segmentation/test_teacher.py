"""The teacher of a lab: features and classes of pixels."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from perception.networks.weights_file import read_weights, write_weights
from perception.segmentation import features
from perception.segmentation.evaluation import score_segmentation
from perception.segmentation.features import hsv_of, patch_features
from perception.segmentation.teacher import TeacherConfig, fit_teacher, load_teacher, save_teacher
from tests.paper_lab import CLASSES
from tests.perception.segmentation.patterned import CONFIG, PATTERNED, patches, samples, teacher
from uav_bt.errors import ValueRangeError, WeightsError

SIZE = {"patch_px": 40, "width_px": 100, "height_px": 90}


def test_one_colour_fills_one_bin_of_each_histogram() -> None:
    hsv = np.full((40, 40, 3), (179, 255, 128), dtype=np.uint8)
    (row,) = features.patch_features(hsv, np.array([[20, 20]]), 40)
    assert row.shape == (190,)
    assert np.flatnonzero(row).tolist() == [89, 90 + 63, 154 + 18]
    assert row.sum() == pytest.approx(3.0)
    # Every level has a bin, and every bin a level.
    reached = features.BIN_OF_LEVEL
    assert set(reached[:180, 0]) == set(range(90))
    assert set(reached[:, 1]) == set(range(90, 154))
    assert set(reached[:, 2]) == set(range(154, 190))


def test_a_patch_starts_half_its_side_before_its_pixel_and_is_whole() -> None:
    for (x, y), (left, top) in {(50, 40): (30, 20), (0, 0): (0, 0), (99, 89): (60, 50)}.items():
        patch = (slice(top, top + 40), slice(left, left + 40))
        assert features.patch_slices(x, y, **SIZE) == patch
    for x, y in ((100, 0), (0, 90), (-1, 0)):
        with pytest.raises(ValueRangeError, match="outside the 100x90"):
            features.patch_slices(x, y, **SIZE)


def test_window_means_are_those_of_the_patches_to_the_last_digits() -> None:
    """Also far from the corner where the integral image starts, and for a plane far from zero."""
    rng = np.random.default_rng(0)
    plane = 100.0 + rng.normal(size=(648, 1152))
    windows = features.WindowMeans(width_px=1152, height_px=648, side_px=40)
    means = features.spread_to_border(windows.of(plane.copy()), 40)
    assert means.shape == plane.shape
    for x, y in [(0, 0), (1151, 647), (1151, 0), *rng.integers(600, size=(20, 2)).tolist()]:
        patch = features.patch_slices(x, y, patch_px=40, width_px=1152, height_px=648)
        assert means[y, x] == pytest.approx(plane[patch].mean(), rel=1e-12)


def test_a_palette_is_a_distribution_over_colours() -> None:
    counts = np.zeros((17, features.COLOUR_COUNT), dtype=np.int64)
    counts[3, 1234] = 50
    likelihood = np.exp(features.palette_of_counts(counts).astype(np.float64))
    np.testing.assert_allclose(likelihood.sum(axis=1), 1.0, rtol=1e-4)
    assert likelihood[3].argmax() == 1234
    np.testing.assert_allclose(likelihood[0], 1.0 / features.COLOUR_COUNT, rtol=1e-4)
    # A colour's code keeps the five highest bits of each channel.
    rgb = np.array([[[255, 0, 0], [7, 8, 0], [0, 0, 255]]], dtype=np.uint8)
    assert features.colour_codes(rgb).tolist() == [[31 << 10, 1 << 5, 31]]


# --- the SVM teacher ------------------------------------------------------------------------------


def test_dense_scores_equal_scikit_learns_decision_function() -> None:
    """To 1e-9 relative, at random pixels, the border's among them."""
    from sklearn.multiclass import OneVsRestClassifier
    from sklearn.svm import LinearSVC

    model = OneVsRestClassifier(
        LinearSVC(C=CONFIG.cost, max_iter=CONFIG.max_iterations, random_state=0)
    ).fit(patches().features, patches().labels)
    (_, rgb, _) = next(samples(1, seed=9))
    hsv = hsv_of(rgb)
    rng = np.random.default_rng(3)
    points = np.stack([rng.integers(160, size=300), rng.integers(90, size=300)], axis=1)
    points[:4] = [(0, 0), (159, 0), (0, 89), (159, 89)]
    expected = model.decision_function(patch_features(hsv, points, 12))
    scores = dict(teacher().scores(hsv))
    actual = np.stack([scores[c][points[:, 1], points[:, 0]] for c in model.classes_], axis=1)
    np.testing.assert_allclose(actual, expected, rtol=1e-9, atol=1e-12)
    best = np.array(model.classes_)[actual.argmax(axis=1)]
    np.testing.assert_array_equal(teacher().window_ids(rgb)[points[:, 1], points[:, 0]], best)


def test_the_teacher_tells_patterns_apart() -> None:
    score = score_segmentation(
        ((teacher().window_ids(rgb), ids) for _, rgb, ids in samples(6, seed=5)), CLASSES
    )
    assert score.role_miou > 0.8
    assert score.accuracy > 0.9
    # A class without picks never wins.
    assert teacher().known == PATTERNED
    assert set(np.unique(teacher().window_ids(next(samples(1, seed=2))[1]))) <= set(PATTERNED)
    for size in ((45, 80, 3), (180, 320, 3), (90, 160, 3)):
        assert teacher().resized(np.zeros(size, dtype=np.uint8)).shape == (90, 160, 3)
    # The paper's map has one piece of each object.
    (_, rgb, ids) = next(samples(1, seed=5))
    made = teacher().paper_ids(rgb)
    assert made.shape == ids.shape
    for class_id in set(np.unique(made)) - {0, 1}:
        count, _ = cv2.connectedComponents((made == class_id).astype(np.uint8), connectivity=8)
        assert count == 2


def test_two_classes_give_two_opposite_machines_and_one_is_refused() -> None:
    two = np.isin(patches().labels, PATTERNED[:2])
    small = replace(patches(), features=patches().features[two], labels=patches().labels[two])
    fitted = fit_teacher(small, CONFIG)
    known = list(PATTERNED[:2])
    decided = small.features @ fitted.weights[known].T + fitted.bias[known]
    np.testing.assert_allclose(decided[:, 0], -decided[:, 1])
    assert (np.array(known)[decided.argmax(axis=1)] == small.labels).mean() > 0.95
    one = small.labels == PATTERNED[0]
    alone = replace(small, features=small.features[one], labels=small.labels[one])
    with pytest.raises(ValueRangeError, match="two classes at least, got 1"):
        fit_teacher(alone, CONFIG)


def test_a_saved_teacher_comes_back_and_one_of_wrong_parts_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "teacher.safetensors"
    save_teacher(path, teacher())
    again = load_teacher(path, CLASSES)
    assert again.config == teacher().config
    np.testing.assert_array_equal(again.weights, teacher().weights)
    np.testing.assert_array_equal(again.bias, teacher().bias)
    np.testing.assert_allclose(again.palette, teacher().palette, atol=5e-3)
    given, stated = read_weights(path, kind="hsv-histogram-svm", remedy="")
    for tensors, details in (
        ({"weights": np.zeros((16, 190))}, {}),
        ({}, {"config": {"patch_px": 700}}),
        ({}, {"config": {"size": 3}}),
        ({}, {"classes": None}),
    ):
        parts = {"kind": "hsv-histogram-svm", "details": {**stated, **details}}
        write_weights(path, {**given, **tensors}, **parts)
        with pytest.raises(WeightsError, match="is not a whole teacher"):
            load_teacher(path, CLASSES)
    with pytest.raises(ValueRangeError, match="does not fit"):
        TeacherConfig(patch_px=700)
