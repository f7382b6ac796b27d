"""The map's objects in a survey without images: ids, places, sizes and heights."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.map_objects import fly, report

pytestmark = pytest.mark.flight


def test_most_objects_are_found_where_they_stand() -> None:
    """The bounds leave room: another processor flies another survey of the same seed."""
    errors = fly("train-a", 0, "lab", 45.0)
    found = len(errors.position_m)
    assert found >= 6
    assert found + errors.missing == 8
    assert errors.false + errors.duplicates <= 2
    assert np.median(errors.one_id) > 0.9
    for values in (errors.position_m, errors.size_m, errors.height_m):
        assert np.median(np.abs(values)) < 0.15
    assert f"{found} objects" in report(errors)
