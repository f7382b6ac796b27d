"""The values that describe a place: its landing mark and its clearances."""

from __future__ import annotations

import math

import pytest

from uav_bt.errors import ValueRangeError
from uav_bt.types import Clearances, LandingMark


def test_the_default_mark_is_the_box_of_the_papers_lab() -> None:
    mark = LandingMark()
    assert mark.size_m == (0.5, 0.5, 0.4)
    assert mark.area_m2 == pytest.approx(0.25)
    assert mark.radius_m == pytest.approx(math.sqrt(0.125))


@pytest.mark.parametrize("given", [{"length_m": 0.0}, {"width_m": -1.0}, {"height_m": -0.1}])
def test_a_mark_without_a_top_is_refused(given: dict[str, float]) -> None:
    with pytest.raises(ValueRangeError, match="landing mark"):
        LandingMark(**given)


def test_a_negative_clearance_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="clearances"):
        Clearances(edge_m=-0.1)


@pytest.mark.parametrize("name", ["PAD_SIZE_M", "PAD_HEIGHT_M", "BODY_SIZE_M"])
def test_the_import_of_a_former_constant_names_its_successor(name: str) -> None:
    import uav_bt.types  # noqa: PLC0415

    with pytest.raises(ImportError, match=r"it is (LandingMark|Airframe)\."):
        getattr(uav_bt.types, name)


def test_a_hull_must_fit_into_the_narrowest_passage() -> None:
    """A hull of 0.35 m needs 0.45 m from obstacles, and its radius from everything else."""
    place = Clearances(obstacle_m=0.44, edge_m=0.34, unknown_m=0.35, lane_m=0.7)
    assert place.below(0.35) == pytest.approx({"obstacle_m": 0.45, "edge_m": 0.35})
    assert Clearances(obstacle_m=0.3, edge_m=0.2).below(0.2) == {}
