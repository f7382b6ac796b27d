"""The map's objects in a survey without images: ids, places, sizes and heights."""

from __future__ import annotations

import pytest

from benchmarks.map_objects import SAME_ID, fly, report

pytestmark = pytest.mark.flight


def test_each_object_keeps_its_id_through_a_survey() -> None:
    errors = fly("train-a", 0, "lab", 60.0)
    assert len(errors.one_id) == 8
    assert min(errors.one_id) >= SAME_ID
    assert (errors.missing, errors.false, errors.duplicates) == (0, 0, 0)
    assert max(errors.position_m) < 0.15
    assert max(map(abs, errors.size_m)) < 0.15
    assert len(errors.height_m) >= 3
    assert max(map(abs, errors.height_m)) < 0.03
    assert "8 objects" in report(errors)
