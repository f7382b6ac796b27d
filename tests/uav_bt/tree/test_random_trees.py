"""No tree that check calls good raises, and check refuses none that is right.

`python -m pytest tests/uav_bt/tree/test_random_trees.py --hypothesis-profile many-trees` draws
other trees each time, and many of them.
"""

from __future__ import annotations

import random

import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st

from tests.uav_bt.tree.random_trees import MISTAKES, raised, refused, right_tree, wrong_tree
from tests.worlds.trees import document

# What is imported late changes the limit.
pytestmark = pytest.mark.filterwarnings("ignore:The recursion limit will not be reset")

draws = st.builds(random.Random, st.integers(0, 2**32 - 1))
few = settings(max_examples=7, derandomize=True)
examples = settings.default if settings.default == settings.get_profile("many-trees") else few


@pytest.mark.parametrize("mistake", MISTAKES)
@examples
@given(draw=draws)
def test_no_tree_that_raises_is_called_good(mistake: str, draw: random.Random) -> None:
    text = wrong_tree(mistake, draw)
    note(text)
    if refused(text) is None:
        assert raised(text, draw) is None


@examples
@given(draw=draws)
def test_trees_without_a_mistake_fly_and_are_not_refused(draw: random.Random) -> None:
    text = right_tree(draw)
    note(text)
    complaint, error = refused(text), raised(text, draw)
    assert (complaint is None) is (error is None), (complaint, error)


@pytest.mark.parametrize("mistake", MISTAKES)
def test_some_trees_of_each_mistake_are_refused(mistake: str) -> None:
    assert any(refused(wrong_tree(mistake, draw)) for draw in map(random.Random, range(20)))


def test_the_oracle_finds_what_check_would_miss() -> None:
    movers = document('<Parallel><HoverFor/><Turn degrees="9"/></Parallel>')
    unset = document('<HoverFor seconds="{nobody}"/>')
    one, other = map(raised, (movers, unset), map(random.Random, range(2)))
    assert "both propose a movement in one tick" in str(one)
    assert "holds nothing" in str(other)
