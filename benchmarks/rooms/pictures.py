"""Looks of the surfaces of generated rooms: photographs of materials, and drawn patterns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.types.arrays import Image

SIDE_PX: Final = 384
PATCHED: Final = 0.3  # share of the surfaces with rectangles of another look
_Colours = NDArray[np.float32]


def draw_surface(photographs: Sequence[Image], rng: np.random.Generator, plain: float) -> Image:
    """Return a picture that repeats without seams, uint8 RGB; a share is nearly of one colour."""
    image = _base(photographs, rng, plain)
    if rng.random() < PATCHED:
        for _ in range(int(rng.integers(1, 4))):
            _paste(image, _base(photographs, rng, plain), rng)
    return np.asarray(np.clip(image, 0, 255), np.uint8)


def _paste(image: _Colours, other: _Colours, rng: np.random.Generator) -> None:
    """Replace a rectangle: a door or picture on a wall, a rug on a floor, a label on a box."""
    low, high = np.sort(rng.integers(0, SIDE_PX, (2, 2)), axis=0)
    part = (slice(low[0], high[0]), slice(low[1], high[1]))
    image[part] = other[part]


def _base(photographs: Sequence[Image], rng: np.random.Generator, plain: float) -> _Colours:
    kind = rng.random()
    if kind < plain:
        image = _noise(rng, strength=rng.uniform(1.0, 8.0)) + _colour(rng)
    elif kind < plain + 0.6 * (1.0 - plain):
        image = _photograph(photographs[int(rng.integers(len(photographs)))], rng)
    else:
        image = _PATTERNS[int(rng.integers(len(_PATTERNS)))](rng)
        image = image + _noise(rng, strength=rng.uniform(2.0, 14.0))
    return np.array(image, np.float32)


def _photograph(photograph: Image, rng: np.random.Generator) -> _Colours:
    """Return a mirrored part of a photograph in another tint and contrast."""
    side = int(min(photograph.shape[:2]) * rng.uniform(0.5, 1.0))
    row, column = (int(rng.integers(0, length - side + 1)) for length in photograph.shape[:2])
    part = np.rot90(photograph[row : row + side, column : column + side], int(rng.integers(4)))
    half = cv2.resize(part, (SIDE_PX // 2,) * 2, interpolation=cv2.INTER_AREA).astype(np.float32)
    grey = half.mean(axis=2, keepdims=True)
    # Half of the surfaces keep the photograph's colours.
    keep = 1.0 if rng.random() < 0.5 else rng.uniform(0.0, 0.8)
    tinted = keep * half + (1.0 - keep) * grey * (_colour(rng) / 128.0)
    middle = tinted.mean(axis=(0, 1))
    tinted = middle * rng.uniform(0.6, 1.3) + (tinted - middle) * rng.uniform(0.5, 1.3)
    upper = np.concatenate([tinted, tinted[:, ::-1]], axis=1)
    return np.concatenate([upper, upper[::-1]]).astype(np.float32)


def _colour(rng: np.random.Generator) -> _Colours:
    """Return a colour, (3,); most materials of a room are pale."""
    hsv = (rng.uniform(0, 180), 255 * rng.beta(1.2, 3.0), 255 * rng.beta(2.5, 1.5))
    pixel = cv2.cvtColor(np.array([[hsv]], np.uint8), cv2.COLOR_HSV2RGB)
    return np.asarray(pixel[0, 0], np.float32)


def _noise(rng: np.random.Generator, strength: float) -> _Colours:
    """Return noise of a random grain that repeats, (SIDE_PX, SIDE_PX, 1)."""
    total = np.zeros((SIDE_PX, SIDE_PX), np.float32)
    for cells in (8, 32, 128, SIDE_PX):
        layer = rng.standard_normal((cells, cells)).astype(np.float32) * rng.random()
        wrapped = np.pad(layer, 1, mode="wrap")
        scale = SIDE_PX // cells
        large = cv2.resize(wrapped, None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR)
        total += large[scale : scale + SIDE_PX, scale : scale + SIDE_PX]
    return np.asarray(strength * total[..., None], np.float32)


def _mixed(share: NDArray[np.float32], rng: np.random.Generator) -> _Colours:
    first = _colour(rng)
    second = _colour(rng) if rng.random() < 0.4 else first * rng.uniform(0.5, 0.9)
    mix = share[..., None]
    return np.asarray((1.0 - mix) * first + mix * second, np.float32)


def _grid(rng: np.random.Generator) -> _Colours:
    """Return tiles with joints."""
    count, joint = int(rng.choice([1, 2, 3, 4, 6])), rng.uniform(0.01, 0.06)
    at = np.arange(SIDE_PX) / SIDE_PX * count % 1.0
    seam = (at < joint) | (at > 1.0 - joint)
    shade = rng.uniform(-12, 12, (count, count)).astype(np.float32)
    large = np.kron(shade, np.ones((SIDE_PX // count,) * 2, np.float32))
    return _mixed((seam[:, None] | seam).astype(np.float32), rng) + large[..., None]


def _planks(rng: np.random.Generator) -> _Colours:
    """Return planks of several tones, with grain along them."""
    count = int(rng.choice([4, 6, 8, 12]))
    height = SIDE_PX // count
    image = np.zeros((SIDE_PX, SIDE_PX, 3), np.float32) + _colour(rng)
    for row in range(count):
        cut = int(rng.integers(0, SIDE_PX))
        tones = rng.uniform(-22, 22, 2)
        band = image[row * height : (row + 1) * height]
        band[:, :cut] += tones[0]
        band[:, cut:] += tones[1]
        band[:2] *= 0.6
        band[:, cut : cut + 2] *= 0.6
    grain = cv2.GaussianBlur(
        rng.standard_normal((SIDE_PX,) * 2).astype(np.float32), (0, 0), 8, None, 0.7
    )
    image += rng.uniform(10, 60) * grain[..., None]
    return np.rot90(image) if rng.random() < 0.5 else image


def _checks(rng: np.random.Generator) -> _Colours:
    count = int(rng.choice([2, 4, 8, 16]))
    small = np.indices((count, count)).sum(axis=0) % 2
    return _mixed(np.kron(small, np.ones((SIDE_PX // count,) * 2)).astype(np.float32), rng)


def _stripes(rng: np.random.Generator) -> _Colours:
    count, share = int(rng.choice([2, 4, 8, 16])), rng.uniform(0.2, 0.8)
    stripe = (np.arange(SIDE_PX) / SIDE_PX * count % 1.0 < share).astype(np.float32)
    image = _mixed(np.tile(stripe, (SIDE_PX, 1)), rng)
    return np.rot90(image) if rng.random() < 0.5 else image


def _speckles(rng: np.random.Generator) -> _Colours:
    """Return the flecks of terrazzo, carpet and chipboard."""
    spots = _noise(rng, 1.0)[..., 0] + rng.standard_normal((SIDE_PX,) * 2).astype(np.float32)
    sharp = np.clip(4.0 * (spots - rng.uniform(-0.5, 2.0)), 0.0, 1.0)
    return _mixed(sharp.astype(np.float32), rng)


_PATTERNS: Final = (_grid, _planks, _planks, _checks, _stripes, _speckles, _speckles)
