"""Points of a view that have arrived on ground seen free before."""

from __future__ import annotations

import numpy as np
import pytest

from perception.mapping.arrivals import ArrivalConfig, find_arrivals
from perception.mapping.landmarks import Landmarks


def landmarks(x_m: float, *, seen_s: float) -> Landmarks:
    """Return one base at a place, settled when it was seen."""
    time_s = np.array([seen_s])
    return Landmarks(
        xy_m=np.array([[x_m, 0.0]]),
        weight=np.ones(1),
        first_s=time_s,
        seen_s=time_s,
        settled_s=time_s,
        from_m=np.zeros((1, 2)),
        ids=np.ones(1, dtype=np.uint8),
        missed=np.zeros(1),
    )


@pytest.mark.parametrize("owned", [False, True])
@pytest.mark.parametrize(("off_m", "arrived"), [(0.05, False), (0.2, True)])
def test_a_point_near_a_standing_one_has_not_arrived(
    *, off_m: float, arrived: bool, owned: bool
) -> None:
    """A mover that passes a box does not take the box's points along."""
    seen, known = landmarks(1.0 + off_m, seen_s=20.0), landmarks(1.0, seen_s=0.0)
    ground, owner = np.array([True]), np.array([owned])
    assert find_arrivals(seen, known, ground, owner, ArrivalConfig()).tolist() == [arrived]


def test_between_a_mover_and_a_standing_point_the_mover_owns_more() -> None:
    config = ArrivalConfig()
    off_m = config.beside_m - config.shared_m / 2.0
    seen, known = landmarks(1.0 + off_m, seen_s=20.0), landmarks(1.0, seen_s=0.0)
    yes, no = np.array([True]), np.array([False])
    assert find_arrivals(seen, known, yes, yes, config).all()
    assert not find_arrivals(seen, known, yes, no, config).any()
