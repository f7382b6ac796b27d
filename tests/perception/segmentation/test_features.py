"""Patches as 190 numbers."""

import numpy as np
import pytest

from perception.segmentation import features
from uav_bt.errors import ValueRangeError

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
