"""Textures: reproducible, seamless, and distinguishable by colour."""

from __future__ import annotations

import itertools

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from sim_bridge.twin import textures


def histogram(image: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return the hue-saturation histogram of an image."""
    hsv = cv2.cvtColor(image, cv2.COLOR_RGB2HSV)
    bins = np.histogram2d(
        hsv[..., 0].ravel(), hsv[..., 1].ravel(), bins=(18, 5), range=((0, 180), (0, 256))
    )[0]
    return np.asarray(bins / bins.sum())


def papers() -> dict[str, NDArray[np.uint8]]:
    named = {f"side {k}": textures.side(k) for k in range(1, 9)}
    named |= {f"roof {k}": textures.roof(k) for k in range(1, 6)}
    return named | {
        "carpet": textures.carpet((5.0, 4.0)),
        "h": textures.helipad_top(),
        "stripes": textures.stripes(),
        "wall": textures.plain(0.8, 1),
    }


def test_all_seventeen_looks_differ_in_colour() -> None:
    """Two textures share at most half of their hue and saturation, without shading."""
    shares = {name: histogram(image) for name, image in papers().items()}
    for (a, x), (b, y) in itertools.combinations(shares.items(), 2):
        assert np.minimum(x, y).sum() < 0.5, (a, b)


def test_a_small_window_shows_a_pattern_s_colours() -> None:
    """Each window of 10 cm has the colours of the whole sheet."""
    window = round(0.10 / textures.TILE_M * 256)
    for k in range(1, 9):
        sheet = textures.side(k)
        whole = histogram(sheet)
        for corner in (0, 60, 120):
            piece = sheet[corner : corner + window, corner : corner + window]
            assert np.minimum(histogram(piece), whole).sum() > 0.6, k


@pytest.mark.parametrize(
    "name", [name for name in papers() if name[:4] in ("side", "roof", "stri")]
)
def test_tiles_repeat_without_a_seam(name: str) -> None:
    """Neighbouring pixels differ across the edge as little as inside."""
    image = papers()[name].astype(np.float64)
    inside = np.abs(np.diff(image, axis=0)).mean(axis=(1, 2))
    across = np.abs(image[0] - image[-1]).mean()
    assert across <= inside.max() + 6.0
    inside = np.abs(np.diff(image, axis=1)).mean(axis=(0, 2))
    across = np.abs(image[:, 0] - image[:, -1]).mean()
    assert across <= inside.max() + 6.0


def test_sheets_are_bytes_in_three_channels() -> None:
    """MuJoCo requires this format."""
    for image in papers().values():
        assert image.dtype == np.uint8
        assert image.ndim == 3
        assert image.shape[2] == 3
