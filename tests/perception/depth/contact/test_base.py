"""Lines of bases: one face, two faces, outliers, too few bearings."""

import math

import numpy as np
import pytest

from perception.depth.contact.base import fit_base

PIXEL_RAD = 1 / 145
HEIGHT_M = 1.5


def slope_of(azimuth: np.ndarray, *faces: tuple[float, float]) -> np.ndarray:
    """Height over range of vertical planes, each by its normal's azimuth and its distance."""
    lines = [HEIGHT_M * np.cos(azimuth - normal) / distance for normal, distance in faces]
    return np.min(lines, axis=0)


@pytest.mark.parametrize("middle", [-2.5, -0.4, 0.0, 0.9])
def test_one_face_is_recovered_at_any_azimuth(middle: float) -> None:
    azimuth = np.linspace(middle - 0.15, middle + 0.15, 50)
    line = fit_base(azimuth, slope_of(azimuth, (middle + 0.3, 2.0)), PIXEL_RAD)
    assert line.corner_rad == math.inf
    assert line.rms_px < 1e-4
    assert line.spread_rad == pytest.approx(0.3)
    beyond = np.array([middle - 0.4, middle + 0.4])
    assert line.slope(beyond) == pytest.approx(slope_of(beyond, (middle + 0.3, 2.0)))


def test_rounding_to_pixels_makes_no_corner_and_specks_do_not_move_the_line() -> None:
    azimuth = np.linspace(-0.1, 0.1, 32)
    exact = slope_of(azimuth, (0.2, 2.5))
    seen = np.tan(np.round(np.arctan(exact) / PIXEL_RAD) * PIXEL_RAD)
    for specks in ([], [3, 24]):
        seen[specks] *= 0.7
        line = fit_base(azimuth, seen, PIXEL_RAD)
        assert line.corner_rad == math.inf
        assert line.slope(azimuth) == pytest.approx(exact, rel=0.01)
    assert fit_base(azimuth[:3], seen[:3], PIXEL_RAD) is None  # three bearings are too few


@pytest.mark.parametrize("corner", [False, True])
def test_the_fit_has_the_least_squares_in_pixels(*, corner: bool) -> None:
    azimuth = np.linspace(-0.2, 0.3, 41)
    faces = ((-0.4, 1.7), (0.9, 1.2)) if corner else ((0.2, 2.0),)
    noise = np.random.default_rng(3).normal(0.0, 0.1 * PIXEL_RAD, 41)
    slope = slope_of(azimuth, *faces) + noise
    line = fit_base(azimuth, slope, PIXEL_RAD)
    weight = 1.0 / ((1.0 + slope**2) * PIXEL_RAD)
    basis = np.column_stack([np.cos(azimuth), np.sin(azimuth)]) * weight[:, None]

    def fitted(part: slice) -> tuple[np.ndarray, float]:
        factors, squares, _, _ = np.linalg.lstsq(basis[part], (slope * weight)[part], rcond=None)
        return factors, float(squares[0])

    splits = [
        (fitted(slice(0, at))[1] + fitted(slice(at, 41))[1], at) for at in range(4, 38) if corner
    ]
    least, at = min(splits, default=(fitted(slice(0, 41))[1], 41))
    parts = [slice(0, at), slice(at, 41)] if corner else [slice(0, 41)]
    assert line.faces == pytest.approx(np.stack([fitted(part)[0] for part in parts]), rel=1e-7)
    assert line.rms_px == pytest.approx(math.sqrt(least / 41))
    if corner:
        apart = slope_of(azimuth, faces[0]) - slope_of(azimuth, faces[1])
        assert line.corner_rad == pytest.approx(azimuth[np.abs(apart).argmin()], abs=0.02)
