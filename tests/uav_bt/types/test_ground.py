"""Turned rectangles on the ground: containment, overlap and distances."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uav_bt.types.ground import Footprint

FOOTPRINTS = st.builds(
    Footprint,
    **dict.fromkeys(("x_m", "y_m"), st.floats(-2.0, 2.0)),
    **dict.fromkeys(("half_x_m", "half_y_m"), st.floats(0.1, 0.8)),
    yaw_rad=st.floats(-4.0, 4.0),
)


def test_a_turned_square_extends_by_half_its_diagonal_and_touching_is_no_overlap() -> None:
    turned = Footprint(x_m=0.0, y_m=0.0, half_x_m=0.5, half_y_m=0.5, yaw_rad=math.pi / 4)
    assert turned.distance_m(1.0, 0.0) == pytest.approx(1.0 - math.sqrt(0.5))
    assert (turned.contains(0.7, 0.0), turned.contains(0.5, 0.5)) == (True, False)
    left, right = (Footprint(x_m=x, y_m=0.2 * x, half_x_m=0.5, half_y_m=0.5) for x in (0.0, 1.0))
    assert not left.overlaps(right)


def outline(footprint: Footprint) -> np.ndarray:
    corners = np.array([*footprint.corners(), footprint.corners()[0]])
    steps = np.linspace(0.0, 1.0, 60)[:, None]
    return np.concatenate([a + steps * (b - a) for a, b in itertools.pairwise(corners)])


@settings(max_examples=60)
@given(a=FOOTPRINTS, b=FOOTPRINTS)
def test_rectangles_overlap_where_their_outlines_meet(a: Footprint, b: Footprint) -> None:
    """Points of the outlines agree; overlap is symmetric."""
    assert a.overlaps(b) == b.overlaps(a)
    pairs = ((a, b), (b, a))
    if min(one.distance_m(x, y) for one, other in pairs for x, y in outline(other)) > 0.03:
        assert not a.overlaps(b)
    if any(one.contains(other.x_m, other.y_m) for one, other in pairs):
        assert a.overlaps(b)
