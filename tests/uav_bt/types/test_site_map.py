"""Places and outlines of the site map, computed by hand."""

from __future__ import annotations

import numpy as np
import pytest

from uav_bt.testing.world import drawn_map
from uav_bt.types.site_map import MapObject


def test_an_outline_has_points_on_all_sides_at_most_a_step_apart() -> None:
    box = MapObject(class_id=1, x_m=1.0, y_m=0.0, size_m=0.4, width_m=0.2, std_m=0.0, seen_s=0.0)
    expected = [
        *((1.2, 0.1), (1.0, 0.1)),  # from corner to corner, two steps a side
        *((0.8, 0.1), (0.8, 0.0)),
        *((0.8, -0.1), (1.0, -0.1)),
        *((1.2, -0.1), (1.2, 0.0)),
    ]
    np.testing.assert_allclose(box.outline_m(0.2), expected, atol=1e-12)


def test_the_middle_of_a_cell_lies_in_it() -> None:
    site_map = drawn_map()  # its corner is at (-3, -3), its cells are 0.1 m wide
    middles_m = site_map.middles_m(np.array([[0, 0], [30, 41]]))
    np.testing.assert_allclose(middles_m, [[-3.0, -3.0], [0.0, 1.1]], atol=1e-12)
    assert site_map.cell_of(*map(float, middles_m[1])) == (30, 41)
    assert site_map.places_m()[30, 41] == pytest.approx(middles_m[1])


def test_a_map_is_shown_by_the_shapes_of_its_arrays() -> None:
    assert "obstacles_m=<0x2 float64>" in repr(drawn_map())
