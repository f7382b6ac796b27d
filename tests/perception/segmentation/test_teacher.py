"""The SVM teacher: dense inference equals scikit-learn patch by patch."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from sklearn.multiclass import OneVsRestClassifier
from sklearn.svm import LinearSVC

from perception.segmentation import teacher as teachers
from perception.segmentation.evaluation import score_segmentation
from perception.segmentation.features import hsv_of, patch_features
from perception.segmentation.training.picks import PickedPatches, draw_picks, gather_patches
from tests.paper_lab import CLASSES
from tests.perception.segmentation.patterned import PATTERNED, samples
from uav_bt.errors import ShapeError, ValueRangeError

CONFIG = teachers.TeacherConfig(width_px=160, height_px=90, patch_px=12)


@pytest.fixture(scope="module")
def patches() -> PickedPatches:
    rng = np.random.default_rng(0)
    drawn = draw_picks(
        ((name, ids) for name, _, ids in samples(12, seed=1)), rng, patch_px=12, total=600
    )
    return gather_patches(drawn, ((name, rgb) for name, rgb, _ in samples(12, seed=1)), 12, CLASSES)


@pytest.fixture(scope="module")
def teacher(patches: PickedPatches) -> teachers.Teacher:
    return teachers.fit_teacher(patches, CONFIG)


def test_dense_scores_equal_scikit_learns_decision_function(patches: PickedPatches) -> None:
    """To 1e-9 relative, at random pixels, the border's among them."""
    model = OneVsRestClassifier(
        LinearSVC(C=CONFIG.cost, max_iter=CONFIG.max_iterations, random_state=0)
    ).fit(patches.features, patches.labels)
    dense = teachers.fit_teacher(patches, CONFIG)
    (_, rgb, _) = next(samples(1, seed=9))
    hsv = hsv_of(rgb)
    rng = np.random.default_rng(3)
    points = np.stack([rng.integers(160, size=300), rng.integers(90, size=300)], axis=1)
    points[:4] = [(0, 0), (159, 0), (0, 89), (159, 89)]
    expected = model.decision_function(patch_features(hsv, points, 12))
    scores = dict(dense.scores(hsv))
    actual = np.stack([scores[c][points[:, 1], points[:, 0]] for c in model.classes_], axis=1)
    np.testing.assert_allclose(actual, expected, rtol=1e-9, atol=1e-12)


def test_the_teacher_tells_patterns_apart(teacher: teachers.Teacher) -> None:
    score = score_segmentation(
        ((teacher.window_ids(rgb), ids) for _, rgb, ids in samples(6, seed=5)), CLASSES
    )
    assert score.role_miou > 0.8
    assert score.accuracy > 0.9


def test_the_papers_map_has_one_piece_of_each_object(teacher: teachers.Teacher) -> None:
    (_, rgb, ids) = next(samples(1, seed=5))
    made = teacher.paper_ids(rgb)
    assert made.shape == ids.shape
    for class_id in set(np.unique(made)) - {0, 1}:
        count, _ = cv2.connectedComponents((made == class_id).astype(np.uint8), connectivity=8)
        assert count == 2


def test_a_class_without_picks_never_wins(teacher: teachers.Teacher) -> None:
    (_, rgb, _) = next(samples(1, seed=2))
    assert set(np.unique(teacher.window_ids(rgb))) <= set(PATTERNED)
    assert teacher.known == PATTERNED


def test_two_classes_give_two_opposite_machines(patches: PickedPatches) -> None:
    two = np.isin(patches.labels, PATTERNED[:2])
    small = replace(patches, features=patches.features[two], labels=patches.labels[two])
    fitted = teachers.fit_teacher(small, CONFIG)
    decided = (
        small.features @ fitted.weights[list(PATTERNED[:2])].T + fitted.bias[list(PATTERNED[:2])]
    )
    np.testing.assert_allclose(decided[:, 0], -decided[:, 1])
    assert (np.array(PATTERNED[:2])[decided.argmax(axis=1)] == small.labels).mean() > 0.95


def test_one_class_is_no_training_set(patches: PickedPatches) -> None:
    one = patches.labels == PATTERNED[0]
    small = replace(patches, features=patches.features[one], labels=patches.labels[one])
    with pytest.raises(ValueRangeError, match="two classes at least, got 1"):
        teachers.fit_teacher(small, CONFIG)


def test_a_saved_teacher_comes_back(teacher: teachers.Teacher, tmp_path: Path) -> None:
    path = tmp_path / "teacher.safetensors"
    teachers.save_teacher(path, teacher)
    again = teachers.load_teacher(path, CLASSES)
    assert again.config == teacher.config
    np.testing.assert_array_equal(again.weights, teacher.weights)
    np.testing.assert_array_equal(again.bias, teacher.bias)
    assert teacher.palette is not None
    assert again.palette is not None
    np.testing.assert_allclose(again.palette, teacher.palette, atol=5e-3)


def test_a_small_picture_and_bad_shapes_are_refused(teacher: teachers.Teacher) -> None:
    with pytest.raises(ValueRangeError, match="smaller than a window of 12"):
        teacher.window_ids(np.zeros((11, 20, 3), dtype=np.uint8))
    with pytest.raises(ShapeError, match="17x190"):
        teachers.Teacher(classes=CLASSES, weights=np.zeros((16, 190)), bias=np.zeros(17))
    with pytest.raises(ValueRangeError, match="does not fit"):
        teachers.TeacherConfig(patch_px=700)


def test_pictures_of_any_size_come_to_the_teachers(teacher: teachers.Teacher) -> None:
    for size in ((45, 80, 3), (180, 320, 3), (90, 160, 3)):
        assert teacher.resized(np.zeros(size, dtype=np.uint8)).shape == (90, 160, 3)
