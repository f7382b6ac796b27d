"""Super-pixels follow edges, cover the image, and have an innermost pixel."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from perception.segmentation.training.pick_images import MAX_WIDTH_PX, find_super_pixels


def _scene(width: int, height: int) -> NDArray[np.uint8]:
    """A noisy image of two colours with a slanted edge."""
    rgb = np.full((height, width, 3), 60, dtype=np.uint8)
    corners = np.array([(0, 0), (width * 2 // 5, 0), (width * 3 // 5, height), (0, height)])
    cv2.fillPoly(rgb, [corners], (180, 150, 120))
    noise = np.random.default_rng(0).integers(0, 12, rgb.shape, dtype=np.uint8)
    return rgb + noise


@pytest.mark.parametrize("size", [(320, 180), (333, 77), (90, 160), (5, 3), (1, 1)])
def test_they_cover_the_image_without_gaps(size: tuple[int, int]) -> None:
    found = find_super_pixels(_scene(*size))
    assert found.ids.shape == size[::-1]
    assert np.array_equal(np.unique(found.ids), np.arange(len(found.innermost)))


def test_each_is_one_piece_of_about_the_same_size_on_one_side_of_an_edge() -> None:
    rgb = _scene(576, 324)
    found = find_super_pixels(rgb)
    sizes = np.bincount(found.ids.ravel())
    assert 400 < 576 * 324 / len(sizes) < 500  # the grid has cells of 20 pixels and more
    assert (sizes < 1600).mean() > 0.95
    for region, (x, y) in enumerate(found.innermost):
        mine = np.pad((found.ids == region).astype(np.uint8), 1)
        assert cv2.connectedComponents(mine, connectivity=8)[0] == 2  # the region and the rest
        if region % 20 == 0:  # the innermost pixel is far from the border
            distance = cv2.distanceTransform(mine, cv2.DIST_L2, 5)[1:-1, 1:-1]
            assert found.ids[y, x] == region
            assert distance[y, x] > distance.max() - 1.5
    share = np.bincount(found.ids.ravel(), weights=(rgb[..., 0] > 120).ravel()) / sizes
    assert (np.minimum(share, 1.0 - share) < 0.1).mean() > 0.99


@pytest.mark.parametrize("width", [1152, 1280, 1999, 3840])
def test_a_large_image_is_shrunk_and_its_pixels_are_found_again(width: int) -> None:
    found = find_super_pixels(_scene(width, width // 2))
    assert found.ids.shape[1] == MAX_WIDTH_PX
    for region in range(0, len(found.innermost), 7):
        x, y = found.innermost_of(region)
        assert 0 <= x < width
        assert found.at(x, y) == region
    assert found.at(width - 1, width // 2 - 1) == found.ids[-1, -1]
