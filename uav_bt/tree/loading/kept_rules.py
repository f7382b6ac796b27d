"""Faults of the rules of a mission: rules that come too late, or that the tree cannot keep."""

from __future__ import annotations

from collections.abc import Iterator

from uav_bt.board import FLIGHT_HEIGHT, ODOMETRY
from uav_bt.tree.loading.findings import Finding, Rule
from uav_bt.tree.loading.node_findings import finding_at
from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.rules import Rules
from uav_bt.types.mission_rules import LandOn


def faults_of_rules(tree: MissionTree) -> Iterator[Finding]:
    """Yield rules that cannot be read before the take-off, or that the tree cannot keep."""
    found = [leaf for leaf in tree.leaves() if isinstance(leaf, Rules)]
    for leaf in found[1:]:
        message = f"the mission has its rules already, in '{found[0].path}': put all in one node"
        yield finding_at(tree, leaf, message, Rule.CHILDREN)
    for leaf in found[:1]:
        late = [port.name for port in leaf.ports if leaf.initial_value(port) is None]
        for name in late:
            message = (
                f"attribute '{name}': the rules are read before the take-off, when the reference "
                "has no value: write the value here, or in an entry of the SubTree"
            )
            yield finding_at(tree, leaf, message, Rule.ATTRIBUTE)
        if not late:
            yield from _unkept(tree, leaf)


def _unkept(tree: MissionTree, leaf: Rules) -> Iterator[Finding]:
    rules = leaf.stated()
    written = {key: each for each in tree.leaves() for key in each.writes}
    if rules.land_on is LandOn.NONE and FLIGHT_HEIGHT in written:
        message = (
            f"attribute 'land_on': 'none' says that the mission never takes off, but "
            f"'{written[FLIGHT_HEIGHT].name}' does: write where it may land, or leave that node out"
        )
        yield finding_at(tree, leaf, message, Rule.ATTRIBUTE)
    if rules.area is not None and ODOMETRY not in written:
        message = (
            f"attribute 'area': the drone keeps within it by board key '{ODOMETRY.name}', which no "
            f"leaf of the tree writes: add {ODOMETRY.writer}"
        )
        yield finding_at(tree, leaf, message, Rule.BOARD_KEY)
