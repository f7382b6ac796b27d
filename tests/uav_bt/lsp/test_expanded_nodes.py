"""The language server at a node that expands to a tree."""

from __future__ import annotations

from pathlib import Path

from behaviours.nodes import NODES
from uav_bt.lsp.desk import Desk
from uav_bt.lsp.explain import hover
from uav_bt.lsp.find import definitions
from uav_bt.lsp.page import Page
from uav_bt.tree import NodeRegistry, Port, SubtreeNode


class ExploreOrTurn(SubtreeNode):
    """Explores, and turns where it is blocked."""

    ports = (Port("policy", str, default="corridor", doc="leaf policy"),)


REGISTRY = NodeRegistry([*NODES, ExploreOrTurn])


def asked(body: str) -> tuple[Desk, Page, int]:
    """Return a document without a folder around it, with a cursor on the node's name or ID."""
    text = f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>'
    page = Page(text, Path("m.xml"))
    return Desk(REGISTRY, lambda: [page], lambda _: None), page, text.index("ExploreOrTurn") + 2


def test_the_definition_is_the_tree_and_then_the_class() -> None:
    shipped, own = definitions(*asked("<ExploreOrTurn/>"))
    assert shipped.uri.endswith("/trees/lib/explore.xml")
    assert own.uri.endswith("/test_expanded_nodes.py")


def test_a_subtree_of_the_library_is_found_from_any_file() -> None:
    (shipped,) = definitions(*asked('<SubTree ID="ExploreOrTurn" policy="corridor"/>'))
    assert shipped.uri.endswith("/trees/lib/explore.xml")


def test_what_is_shown_has_the_ports_and_the_keys_of_the_leaves_inside() -> None:
    shown = hover(*asked("<ExploreOrTurn/>"))
    assert shown is not None
    text = str(shown.contents)
    assert "**ExploreOrTurn** (SubTree)" in text
    assert "`policy` (str, default corridor): leaf policy" in text
    assert "`@held_turn`" in text
