"""The places of a tree file in the drawing of a lab."""

from __future__ import annotations

import math

import pytest

from uav_bt.app.tree_places import drawn_places
from uav_bt.tree import parse_tree
from uav_bt.types import Pose2D

TREE = """<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence>
  <LoopString queue="start:2,0;lab:0.5,1@90;mark" value="{p}"><GoTo to="{p}"/></LoopString>
  <GoTo to="start:2,0"/><Face at="90"/><GoTo to="body:1,0"/>
</Sequence></BehaviorTree></root>"""
UP = Pose2D(x_m=-1.0, y_m=0.0, yaw_rad=math.pi / 2)


def test_each_known_place_is_drawn_once() -> None:
    found = dict(drawn_places(parse_tree(TREE), UP))
    assert list(found) == ["start:2,0", "lab:0.5,1@90"]
    assert found["start:2,0"] == pytest.approx((-1.0, 2.0))
    assert found["lab:0.5,1@90"] == (0.5, 1.0)


def test_without_a_take_off_pose_only_places_of_the_drawing_are_known() -> None:
    assert [text for text, _ in drawn_places(parse_tree(TREE), None)] == ["lab:0.5,1@90"]
