"""Margins of a place, and the distances that a route keeps by them."""

from __future__ import annotations

import pytest

from behaviours.path.margins import Margins
from uav_bt.types import Clearances


def test_the_margins_of_the_default_place_are_the_defaults() -> None:
    assert Margins().within(Clearances()) == Margins()


def test_a_place_that_asks_for_more_room_widens_every_distance_from_obstacles() -> None:
    margins = Margins().within(Clearances(obstacle_m=0.5, edge_m=0.45, unknown_m=0.3, lane_m=0.9))
    assert margins.touch_m == pytest.approx(0.5)
    assert margins.wide_m == pytest.approx(Margins.wide_m + 0.1)
    assert margins.tight_m == pytest.approx(Margins.tight_m + 0.1)
    assert margins.tightest_m == pytest.approx(0.4)
    assert (margins.edge_m, margins.unknown_m, margins.lane_m) == pytest.approx((0.45, 0.3, 0.9))
    assert margins.min_start_m == Margins.min_start_m


def test_a_place_that_asks_for_less_keeps_the_order_of_the_distances() -> None:
    margins = Margins().within(Clearances(obstacle_m=0.35))
    assert margins.min_start_m <= margins.touch_m < margins.wide_m
    assert margins.tightest_m == pytest.approx(0.25)
