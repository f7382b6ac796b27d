"""Margins of a place, and the distances that a route keeps by them."""

from __future__ import annotations

import numpy as np
import pytest

from behaviours.path.margins import Margins, Passage
from uav_bt.types import Clearances, LandingMark


def test_the_margins_of_the_default_place_are_the_defaults() -> None:
    assert Margins().within(Clearances()) == Margins()


def test_a_place_that_asks_for_more_room_widens_every_distance_from_obstacles() -> None:
    margins = Margins().within(Clearances(obstacle_m=0.5, edge_m=0.45, unknown_m=0.3, lane_m=0.9))
    assert margins.touch_m == pytest.approx(0.5)
    assert margins.wide_m == pytest.approx(Margins.wide_m + 0.1)
    assert margins.tight().touch_m == pytest.approx(Margins().tight().touch_m + 0.1)
    assert margins.through(Passage.TIGHTEST).touch_m == pytest.approx(0.4)
    assert (margins.edge_m, margins.unknown_m, margins.lane_m) == pytest.approx((0.45, 0.3, 0.9))
    assert margins.min_start_m == Margins.min_start_m


def test_a_place_that_asks_for_less_keeps_the_order_of_the_distances() -> None:
    margins = Margins().within(Clearances(obstacle_m=0.35))
    assert margins.min_start_m <= margins.touch_m < margins.wide_m
    assert margins.through(Passage.TIGHTEST).touch_m == pytest.approx(0.25)


def test_margins_that_differ_from_the_default_keep_their_difference() -> None:
    """Exactly where the place is the default."""
    further = Margins(touch_m=0.38, edge_m=0.4)
    assert further.within(Clearances()) == further
    assert further.within(Clearances(edge_m=0.5)).edge_m == pytest.approx(0.6)


def test_the_last_metres_before_the_mark_keep_a_wider_edge() -> None:
    before_m = Margins().at_pad().edge_m
    assert Margins().within(Clearances(edge_m=0.6)).at_pad().edge_m == pytest.approx(before_m + 0.3)
    assert Margins().within(Clearances(edge_m=0.2)).at_pad().edge_m == before_m


def test_the_last_metres_before_the_mark_keep_more_room_as_well() -> None:
    margins = Margins().within(Clearances(obstacle_m=0.6))
    assert margins.at_pad().touch_m == pytest.approx(Margins().at_pad().touch_m + 0.2)
    assert margins.tight().touch_m <= margins.at_pad().touch_m


def test_a_mark_that_is_flown_over_is_free_to_its_corners() -> None:
    """Half of the diagonal of 0.6 x 0.8 m is 0.5 m, and a cell is 0.1 m."""
    mark = LandingMark(length_m=0.6, width_m=0.8, height_m=0.05)
    assert Margins().within(Clearances(), mark).over_m == pytest.approx(0.6)


def test_the_way_out_is_as_narrow_as_the_place_permits() -> None:
    """Nearer than other passages to edges only, and not nearer than the last metres are."""
    out = Margins().through(Passage.OUT)
    assert (out.touch_m, out.edge_m) == pytest.approx((0.3, 0.2))
    assert out.unknown_m == Margins.unknown_m
    assert out.speed_mps(np.array([0.3])) == pytest.approx(0.1)
    wide = Margins().within(Clearances(obstacle_m=0.5, edge_m=0.45)).through(Passage.OUT)
    assert (wide.touch_m, wide.edge_m) == pytest.approx((0.4, 0.35))
    assert Margins().within(Clearances(edge_m=0.15)).through(Passage.OUT).edge_m == pytest.approx(
        0.15
    )
