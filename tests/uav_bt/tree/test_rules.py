"""Rules of a mission: read before the take-off, one node at most, and such as can be kept."""

from __future__ import annotations

import pytest

from tests.worlds.tables import cases
from tests.worlds.trees import check, document, subtree
from uav_bt.board import FLIGHT_HEIGHT, ODOMETRY
from uav_bt.errors import InputError
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, parse_tree
from uav_bt.tree.rules import Rules
from uav_bt.types.place import LandOn, MissionRules

CASES = cases("missions")


class Up(Leaf):
    """Takes off."""

    moves = True
    writes = (FLIGHT_HEIGHT,)


class Track(Leaf):
    """Keeps the odometry."""

    writes = (ODOMETRY,)


REGISTRY = NodeRegistry([Rules, Up, Track])
SQUARE = "start:-1,-1; start:3,-1; lab:3,1; start:-1,1"


def messages(body: str, inner: str = "<AlwaysSuccess/>") -> list[str]:
    text = document(body, subtree("Inner", inner))
    return [each.message for each in check(text, REGISTRY)]


def stated(body: str, inner: str = "<AlwaysSuccess/>") -> MissionRules:
    tree: MissionTree = parse_tree(document(body, subtree("Inner", inner)), REGISTRY)
    (leaf,) = (leaf for leaf in tree.leaves() if isinstance(leaf, Rules))
    return leaf.stated()


def test_rules_are_read_from_the_file() -> None:
    assert stated("<Rules/>") == MissionRules(land_on=LandOn.MARK)
    rules = stated(f'<Rules time_limit_s="90" land_on="any" area="{SQUARE}"/>')
    assert (rules.time_limit_s, rules.land_on) == (90.0, LandOn.ANY)
    assert [str(corner) for corner in rules.area or ()] == SQUARE.split("; ")


def test_an_entry_of_a_subtree_is_known_before_the_take_off() -> None:
    body, inner = '<SubTree ID="Inner" limit="45"/>', '<Rules time_limit_s="{limit}"/>'
    assert messages(body, inner) == []
    assert stated(body, inner).time_limit_s == 45.0


@pytest.mark.parametrize(("body", "words"), CASES["refused_rules"])
def test_rules_that_cannot_be_kept_are_refused(body: str, words: str) -> None:
    (message,) = messages(body)
    assert words in message


def test_rules_that_can_be_kept_are_good() -> None:
    assert messages(f'<Sequence><Rules area="{SQUARE}"/><Track/><Up/></Sequence>') == []
    assert messages('<Sequence><Rules land_on="none"/><Track/></Sequence>') == []


def test_python_gets_the_same_error() -> None:
    with pytest.raises(InputError, match="expected one of mark, ground, any, none"):
        Rules(land_on="box")
