"""The carpet's straight edges from the points that were seen on them."""

from __future__ import annotations

import numpy as np
import pytest

from behaviours.path.straight_edges import straight_edges

SIDE = np.column_stack([np.linspace(-0.5, 1.5, 41), np.full(41, 0.8)])
AHEAD = np.column_stack([np.full(31, 1.5), np.linspace(-0.7, 0.8, 31)])


def test_a_side_and_the_end_ahead_are_two_lines() -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.02, (72, 2))

    lines = straight_edges(np.vstack([SIDE, AHEAD]) + noise)

    assert len(lines) == 2
    for normal, range_m in ((np.array([0.0, 1.0]), 0.8), (np.array([1.0, 0.0]), 1.5)):
        found = [line for line in lines if float(line[0] @ normal) > 0.99]
        assert len(found) == 1
        assert found[0][1] == pytest.approx(range_m, abs=0.05)


def test_normals_point_outwards_wherever_the_edge_lies() -> None:
    (normal, range_m), *_ = straight_edges(-SIDE)

    assert range_m > 0.0
    assert normal == pytest.approx((0.0, -1.0), abs=1e-6)


@pytest.mark.parametrize(
    "points",
    [np.empty((0, 2)), SIDE[:5], SIDE[:12], np.random.default_rng(2).uniform(-2.0, 2.0, (30, 2))],
    ids=["none", "few", "short", "scattered"],
)
def test_what_is_no_line_is_none(points: np.ndarray) -> None:
    assert straight_edges(points) == []


def test_an_edge_with_carpet_beyond_it_is_no_side_of_the_carpet() -> None:
    """A stripe across the carpet that was taken for its end: the real one was seen behind it."""
    stripe = SIDE[::2] - (0.0, 0.5)

    lines = straight_edges(np.vstack([stripe, SIDE]))

    assert [round(range_m, 2) for _, range_m in lines] == [0.8]
