"""What shipped leaves declare about themselves agrees with their code."""

from __future__ import annotations

import inspect

import pytest

from behaviours.fly.explore import Explore
from behaviours.fly.moving_leaf import MovingLeaf
from behaviours.nodes import NODES
from uav_bt.errors import NodeFailedError
from uav_bt.testing import LeafBench
from uav_bt.tree import Leaf, Port, Status
from uav_bt.tree.loading.attributes import POLICY_PORT

LEAVES = [node for node in NODES if issubclass(node, Leaf)]
WORDS = {"SUCCESS": Status.SUCCESS, "FAILURE": Status.FAILURE}


@pytest.mark.parametrize("leaf", LEAVES, ids=lambda leaf: leaf.__name__)
def test_the_description_names_declared_answers_only(leaf: type[Leaf]) -> None:
    first = inspect.cleandoc(leaf.__doc__ or "").partition("Args:")[0]
    for word, status in WORDS.items():
        assert word not in first or status in leaf.answers, (leaf.__name__, word)


@pytest.mark.parametrize("leaf", LEAVES, ids=lambda leaf: leaf.__name__)
def test_the_code_returns_declared_answers_only(leaf: type[Leaf]) -> None:
    """Of the statuses that the class's own module returns, none is undeclared."""
    shared = {MovingLeaf.fails, MovingLeaf.moved}  # return FAILURE for the leaves that call them
    source = "".join(
        inspect.getsource(method)
        for base in leaf.__mro__
        if base.__module__.startswith("behaviours.")
        for method in vars(base).values()
        if inspect.isfunction(method) and method not in shared
    )
    for status in (Status.FAILURE, Status.RUNNING):
        if f"return Status.{status.name}" in source:
            assert status in leaf.answers
    if "self.fails(" in source or "self.moved(" in source:
        assert Status.FAILURE in leaf.answers


@pytest.mark.parametrize("leaf", LEAVES, ids=lambda leaf: leaf.__name__)
def test_a_leaf_that_turns_the_camera_points(leaf: type[Leaf]) -> None:
    if issubclass(leaf, MovingLeaf):
        overrides = leaf.gimbal_pitch_rad is not MovingLeaf.gimbal_pitch_rad
        assert leaf.points is overrides
        assert leaf.moves


def test_explore_points_the_camera_where_it_looks_down() -> None:
    assert not Explore(None, policy="segmentation").may_point()
    assert Explore(None, policy="segmentation", looks_down="true").may_point()
    assert Explore(None, policy="segmentation", looks_down="{far}").may_point()


@pytest.mark.parametrize(
    ("leaf", "port"),
    [(leaf, port) for leaf in LEAVES for port in leaf.ports if port.direction == "input"],
    ids=lambda value: value.name if isinstance(value, Port) else value.__name__,
)
def test_ports_that_are_read_at_the_setup_are_declared(
    leaf: type[Leaf], port: Port[object]
) -> None:
    """Without a value of their variable the setup raises."""
    given = {one.name: one.sample or "1" for one in leaf.ports if one.required}
    bench = LeafBench(leaf, **{**given, port.name: "{nothing}"})
    if port.at_setup or port.name == POLICY_PORT:
        with pytest.raises(NodeFailedError, match=r"\{nothing\} holds nothing"):
            bench.setup()
    else:
        bench.setup()
