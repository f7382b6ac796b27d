"""Training pictures change within the limits, and their labels move along."""

import cv2
import numpy as np
import pytest

from perception.segmentation.training.augment import AugmentConfig, augmented
from tests.perception.segmentation.patterned import samples
from uav_bt.errors import ShapeError, ValueRangeError

STILL = AugmentConfig(hue_deg=0.0, saturation=0.0, value=0.0, rotation_deg=0.0, shift=0.0)


def test_without_changes_the_labels_are_the_same_and_the_colours_nearly() -> None:
    """HSV in eight bits and back costs a few levels."""
    (_, rgb, ids) = next(samples(1, seed=0))
    changed, moved = augmented(rgb, ids, np.random.default_rng(0), STILL)
    np.testing.assert_array_equal(moved, ids)
    assert np.abs(changed.astype(int) - rgb.astype(int)).mean() < 2.0


def test_colours_stay_within_the_papers_limits() -> None:
    """Hue by up to 5 degrees, saturation by 2 %, value by 6 %."""
    config = AugmentConfig(rotation_deg=0.0, shift=0.0)
    rgb = np.full((20, 20, 3), (200, 90, 40), dtype=np.uint8)
    ids = np.zeros((20, 20), dtype=np.uint8)
    before = cv2.cvtColor(rgb, cv2.COLOR_RGB2HSV)[0, 0].astype(float)
    rng = np.random.default_rng(0)
    for _ in range(100):
        changed, _ = augmented(rgb, ids, rng, config)
        after = cv2.cvtColor(changed, cv2.COLOR_RGB2HSV)[10, 10].astype(float)
        assert abs(after[0] - before[0]) * 2.0 <= 5.0 + 2.0  # 8-bit hue counts in two degrees
        assert abs(after[1] / before[1] - 1.0) <= 0.02 + 0.01
        assert abs(after[2] / before[2] - 1.0) <= 0.06 + 0.01


def test_labels_move_with_their_pixels() -> None:
    ids = np.zeros((90, 160), dtype=np.uint8)
    ids[30:60, 40:120] = 4
    rgb = np.repeat((ids[..., None] > 0) * np.uint8(200), 3, axis=2)
    config = AugmentConfig(hue_deg=0.0, saturation=0.0, value=0.0)
    rng = np.random.default_rng(1)
    for _ in range(20):
        changed, moved = augmented(rgb, ids, rng, config)
        agree = (changed[..., 0] > 100) == (moved == 4)
        assert agree.mean() > 0.98


def test_the_same_generator_gives_the_same_change() -> None:
    (_, rgb, ids) = next(samples(1, seed=0))
    first, second = (
        augmented(rgb, ids, np.random.default_rng(5), AugmentConfig()) for _ in range(2)
    )
    np.testing.assert_array_equal(first[0], second[0])
    np.testing.assert_array_equal(first[1], second[1])


def test_labels_of_another_size_and_negative_limits_are_refused() -> None:
    with pytest.raises(ShapeError, match="90x160"):
        augmented(
            np.zeros((90, 160, 3), np.uint8),
            np.zeros((90, 80), np.uint8),
            np.random.default_rng(0),
            STILL,
        )
    with pytest.raises(ValueRangeError, match="must not be negative"):
        AugmentConfig(shift=-0.1)
