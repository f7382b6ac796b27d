"""Rotated rectangles: containment, overlap and distances."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uav_bt.types.ground import Footprint

PLACES = st.floats(-2.0, 2.0)
HALVES = st.floats(0.1, 0.8)
TURNS = st.floats(-4.0, 4.0)
FOOTPRINTS = st.builds(
    Footprint, x_m=PLACES, y_m=PLACES, half_x_m=HALVES, half_y_m=HALVES, yaw_rad=TURNS
)


def test_known_distances() -> None:
    """A square rotated by 45 degrees extends by half its diagonal."""
    turned = Footprint(x_m=0.0, y_m=0.0, half_x_m=0.5, half_y_m=0.5, yaw_rad=math.pi / 4)
    assert turned.distance_m(1.0, 0.0) == pytest.approx(1.0 - math.sqrt(0.5))
    assert turned.contains(0.7, 0.0)
    assert not turned.contains(0.5, 0.5)


def test_touching_is_no_overlap() -> None:
    """Two boxes may touch with their faces."""
    left = Footprint(x_m=0.0, y_m=0.0, half_x_m=0.5, half_y_m=0.5)
    right = Footprint(x_m=1.0, y_m=0.2, half_x_m=0.5, half_y_m=0.5)
    assert not left.overlaps(right)


def _outline(footprint: Footprint) -> np.ndarray:
    corners = np.array([*footprint.corners(), footprint.corners()[0]])
    steps = np.linspace(0.0, 1.0, 60)[:, None]
    return np.concatenate([a + steps * (b - a) for a, b in itertools.pairwise(corners)])


@settings(max_examples=60, deadline=None)
@given(a=FOOTPRINTS, b=FOOTPRINTS)
def test_rectangles_overlap_where_their_outlines_meet(a: Footprint, b: Footprint) -> None:
    """Brute force over points of the outlines agrees; overlap is symmetric."""
    assert a.overlaps(b) == b.overlaps(a)
    pairs = ((a, b), (b, a))
    nearest_m = min(one.distance_m(x, y) for one, other in pairs for x, y in _outline(other))
    if nearest_m > 0.03:
        assert not a.overlaps(b)
    if any(one.contains(other.x_m, other.y_m) for one, other in pairs):
        assert a.overlaps(b)
