"""Images for training: sharp ones that differ from each other."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from perception.segmentation.training.frame_choice import clear_ones, different_ones, look_at

Grey = NDArray[np.uint8]


def pattern(seed: int) -> Grey:
    """Return 180x320 grey rectangles."""
    random = np.random.default_rng(seed)
    return np.kron(random.integers(40, 220, (18, 32)), np.ones((10, 10))).astype(np.uint8)


def blurred(grey: Grey, sigma_px: float) -> Grey:
    return np.asarray(cv2.GaussianBlur(grey, (0, 0), sigma_px), dtype=np.uint8)


def noisy(grey: Grey, seed: int) -> Grey:
    noise = np.random.default_rng(seed).normal(0.0, 4.0, grey.shape)
    return np.clip(grey + noise, 0, 255).astype(np.uint8)


def test_blur_lowers_the_sharpness_and_the_size_does_not() -> None:
    sharp, soft = (look_at(blurred(pattern(0), sigma)).sharpness for sigma in (0.5, 3.0))
    assert sharp > 10.0 * soft
    large = np.asarray(cv2.resize(pattern(0), (1280, 720), interpolation=cv2.INTER_NEAREST))
    assert look_at(large).sharpness == pytest.approx(look_at(pattern(0)).sharpness, rel=0.01)


def test_blurred_and_blank_images_are_left_out() -> None:
    """One colour, black, the noise of a dark image, dark."""
    plain, black = np.full((180, 320), 130, np.uint8), np.zeros((180, 320), np.uint8)
    blank = [plain, black, noisy(black + np.uint8(8), 1), (pattern(0) // 20).astype(np.uint8)]
    sharp = [pattern(seed) for seed in range(4)]
    assert [look_at(image).blank for image in [*blank, *sharp]] == [True] * 4 + [False] * 4
    clear = clear_ones([look_at(image) for image in [*sharp, blurred(pattern(4), 4.0), black]])
    assert clear.tolist() == [True] * 4 + [False] * 2
    # None of a video out of focus is clear.
    assert not clear_ones([look_at(blurred(image, 12.0)) for image in sharp]).any()
    assert clear_ones([]).shape == (0,)


def test_nearly_the_same_images_are_taken_once() -> None:
    brighter = np.clip(pattern(1) * 0.8 + 50.0, 0, 255).astype(np.uint8)
    images = [pattern(0), noisy(pattern(0), 1), pattern(1), noisy(pattern(1), 2), brighter]
    chosen = different_ones([look_at(image) for image in images])
    assert {index // 2 for index in chosen if index < 4} == {0, 1}
    assert len(chosen) == 2
    assert different_ones([]) == []
    # The farthest image follows the sharpest.
    half = pattern(0)
    half[:, 160:] = pattern(1)[:, 160:]
    images = [blurred(half, 1.0), pattern(0), blurred(pattern(1), 1.0)]
    assert different_ones([look_at(image) for image in images]) == [1, 2, 0]
