"""Short notation for trees of scripted leaves, for the tests of the tree language."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tests.conformance import Scripted
from uav_bt.board.blackboard import Blackboard
from uav_bt.board.context import MissionContext, Proposals
from uav_bt.clock import ManualClock
from uav_bt.tree import MissionTree, NodeRegistry, parse_tree
from uav_bt.tree.loading.findings import Finding, Rule
from uav_bt.tree.loading.loader import check_text


class World:
    """Makes trees of scripted leaves, and has their clock."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.registry = NodeRegistry([Scripted])
        self.proposals = Proposals()
        self.board = Blackboard(self.clock, ())
        Scripted.events.clear()

    @property
    def context(self) -> MissionContext:
        """A mission context without policies."""
        return MissionContext(
            board=self.board,
            clock=self.clock,
            proposals=self.proposals,
            policy=lambda name: (_ for _ in ()).throw(LookupError(name)),
        )

    def events(self) -> list[str]:
        """Return the leaves' calls since the last request, as `start a`."""
        calls = [" ".join(event) for event in Scripted.events]
        Scripted.events.clear()
        return calls

    def tree(self, body: str, *more: str) -> MissionTree:
        """Return a tree, set up, from the XML of its root node; `more` are further trees."""
        tree = parse_tree(document(body, *more), self.registry)
        tree.setup(self.context)
        return tree

    def run(self, body: str, ticks: int) -> str:
        """Tick a new tree and return its answers, one letter each."""
        tree = self.tree(body)
        return "".join(tree.tick().letter for _ in range(ticks))


def check(text: str, registry: NodeRegistry | None = None, **given: Any) -> tuple[Finding, ...]:
    """Return the findings about a part of a mission, which neither takes off nor lands."""
    found = check_text(text, registry, path=Path("m.xml"), **given)
    return tuple(one for one in found if one.rule is not Rule.MISSION)


def document(body: str, *more: str, tree_id: str = "Main") -> str:
    """Return a tree file with a main tree of that body; `more` are further elements."""
    return (
        f'<root BTCPP_format="4" main_tree_to_execute="{tree_id}">'
        f'<BehaviorTree ID="{tree_id}">{body}</BehaviorTree>{"".join(more)}</root>'
    )


def subtree(tree_id: str, body: str) -> str:
    """Return the XML of a further tree."""
    return f'<BehaviorTree ID="{tree_id}">{body}</BehaviorTree>'


def tree_file(folder: Path, body: str, name: str = "mission.xml", *more: str) -> Path:
    """Write a tree file with a main tree of that body; `more` are further elements."""
    path = folder / name
    path.write_text(document(body, *more), encoding="utf-8")
    return path


def leaf(name: str, script: str, more: str = "") -> str:
    """Return the XML of a scripted leaf; `more` are further attributes."""
    return f'<Scripted name="{name}" script="{script}" {more}/>'
