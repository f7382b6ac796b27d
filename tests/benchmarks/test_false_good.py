"""No tree that check calls good raises, and check refuses none that is right."""

from __future__ import annotations

from collections import Counter

import pytest

from benchmarks.false_good import Case, judge, right_cases, wrong_cases
from benchmarks.random_leaves import raises_within
from benchmarks.wrong_trees import MISTAKES, wrong_tree
from uav_bt.tree import NodeRegistry

TICKS = 150  # the command ticks 2,000 times


@pytest.fixture(scope="module")
def registry() -> NodeRegistry:
    return NodeRegistry.installed()


@pytest.fixture(scope="module")
def wrong(registry: NodeRegistry) -> list[Case]:
    return wrong_cases(60, registry, first=0, ticks=TICKS)


def test_no_tree_that_raises_is_called_good(wrong: list[Case]) -> None:
    assert [(case.seed, case.mistake, case.raised) for case in wrong if case.is_false_good] == []


def test_the_trees_have_all_kinds_of_mistakes_and_many_are_refused(wrong: list[Case]) -> None:
    assert {case.mistake for case in wrong} == set(MISTAKES)
    refused = Counter(case.refused is not None for case in wrong)
    assert refused[True] >= 20
    assert refused[False] >= 10  # some are right by chance, and fly


def test_trees_without_a_mistake_are_not_refused(registry: NodeRegistry) -> None:
    cases = right_cases(40, registry, first=0, ticks=TICKS)
    assert [case.refused for case in cases if case.refused and case.raised is None] == []
    assert not any(case.is_false_good for case in cases)


def test_the_oracle_finds_what_check_would_miss(registry: NodeRegistry) -> None:
    """Two leaves that move at once raise, and so does a variable without a value."""
    text = (
        '<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M">{}'
        "</BehaviorTree></root>"
    )
    movers = text.format('<Parallel><HoverFor/><Turn degrees="9"/></Parallel>')
    raised = raises_within(movers, registry, ticks=TICKS, seed=0)
    assert raised is not None
    assert "both propose a movement in one tick" in raised
    unset = text.format('<HoverFor seconds="{nobody}"/>')
    assert "holds nothing" in str(raises_within(unset, registry, ticks=TICKS, seed=0))
    assert judge(0, "none", unset, registry, ticks=1).refused is not None


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_seed_makes_the_same_tree(seed: int) -> None:
    assert wrong_tree(seed) == wrong_tree(seed) != wrong_tree(seed + 1)
