"""Faults of a whole tree that would end its flight, each found by one function.

A new check is a function that yields faults, below `everywhere` or `in_missions`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Final, NamedTuple

from uav_bt.board import FLIGHT_HEIGHT, MISSION_KEYS, ODOMETRY, Key
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.attributes import POLICY_PORT
from uav_bt.tree.loading.early_reads import early_reads
from uav_bt.tree.loading.findings import ERROR, WARNING, Finding, Position, Rule
from uav_bt.tree.loading.kinds import misfits
from uav_bt.tree.loading.uses import Slot, Use, Uses, is_named
from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.node import Node
from uav_bt.tree.nodes import LoopBool, LoopDouble, LoopInt, SetBlackboard
from uav_bt.tree.rules import Rules
from uav_bt.tree.script.expressions import Name
from uav_bt.types.mission_rules import LandOn, MissionRules

_RUNNER: Final = "runner"  # the writer of the keys that every mission has


class Fault(NamedTuple):
    """What would end the flight, at a node."""

    node: Node
    message: str  # the mistake and the remedy
    rule: Rule
    severity: str = ERROR


_Check = Callable[[MissionTree], Iterator[Fault]]
_EVERYWHERE: list[_Check] = []
_IN_MISSIONS: list[_Check] = []


def everywhere(check: _Check) -> _Check:
    """Run a check on every tree: its faults are faults in each mission that uses the tree."""
    _EVERYWHERE.append(check)
    return check


def in_missions(check: _Check) -> _Check:
    """Run a check on trees that are flown as they are."""
    _IN_MISSIONS.append(check)
    return check


def faults_of(tree: MissionTree) -> Iterator[Finding]:
    """Yield the faults of a tree that is flown as it is."""
    yield from _found(tree, *_EVERYWHERE, *_IN_MISSIONS)


def faults_of_part(tree: MissionTree) -> Iterator[Finding]:
    """Yield the faults that a tree has in every mission that uses it."""
    yield from _found(tree, *_EVERYWHERE)


def _found(tree: MissionTree, *checks: _Check) -> Iterator[Finding]:
    for check in checks:
        for node, message, rule, severity in check(tree):
            place = tree.places.get(node.path)
            at = (tree.path, Position(1, 1)) if place is None else (place.path, place.position)
            yield Finding(str(at[0]), at[1], message, node.path, severity, rule)


def unset_reads(uses: Uses) -> dict[str, Use]:
    """Return the variables of a main tree that its file reads and nothing sets, with a reader."""
    slots = (slot for slot in uses.slots.values() if slot.scope is uses.main)
    unset = ((one.name, read) for one in slots if not one.created for read in one.reads)
    first: dict[str, Use] = {}
    for name, read in unset:
        if read.needed or read.named:
            first.setdefault(name, read.use)
    return first


# --- nodes with children --------------------------------------------------------------------------


@everywhere
def _loops_over_words(tree: MissionTree) -> Iterator[Fault]:
    """Yield loops over numbers or truth values whose queue is a board key that holds a text."""
    texts = {key.name for leaf in tree.leaves() for key in leaf.writes if key.type is str}
    for node in tree.nodes():
        if isinstance(node, LoopBool | LoopDouble | LoopInt):
            at = node.reference(node.QUEUE)
            if at is not None and at.on_board and at.key in texts:
                message = (
                    f"attribute 'queue': board key '{at.key}' holds a text, which may be no queue "
                    f"of {node.VALUE.type.__name__}: use LoopString"
                )
                yield Fault(node, message, Rule.BOARD_KEY)


@everywhere
def _two_movers(tree: MissionTree) -> Iterator[Fault]:
    """Yield nodes that tick children together of which two may ask for the same thing."""
    for node in (one for one in tree.nodes() if one.ticks_together):
        leaves = [list(_leaves_below(child)) for child in node.children]
        movers = [next((leaf for leaf in below if leaf.moves), None) for below in leaves]
        pointers = [next((leaf for leaf in below if leaf.may_point()), None) for below in leaves]
        for what, found in (("a movement", movers), ("a camera direction", pointers)):
            asks = [leaf for leaf in found if leaf is not None]
            if len(asks) > 1:
                message = (
                    f"'{asks[0].name}' and '{asks[1].name}' may ask for {what} in the same tick, "
                    "and only one leaf may: run them one after another"
                )
                yield Fault(node, message, Rule.CHILDREN)


def _leaves_below(node: Node) -> Iterator[Leaf]:
    """Yield the leaves of a branch, itself included; none of a branch that is deactivated."""
    if node.condition_scripts.get("_skipIf", "").strip() in {"true", "1"}:
        return
    if isinstance(node, Leaf):
        yield node
    for child in node.children:
        yield from _leaves_below(child)


@everywhere
def _skipped_conditions(tree: MissionTree) -> Iterator[Fault]:
    """Yield conditions of nodes such as `IfThenElse` that may be skipped."""
    for node in (one for one in tree.nodes() if one.asks_first):
        asked = node.children[0]
        for attribute in ("_skipIf", "_while"):
            if attribute in asked.condition_scripts:
                message = (
                    f"attribute '{attribute}': the condition of {node.node_id} must not be "
                    "skipped: ask this in a ScriptCondition before"
                )
                yield Fault(asked, message, Rule.CHILDREN)


# --- rules of a mission ---------------------------------------------------------------------------


@everywhere
def _rules(tree: MissionTree) -> Iterator[Fault]:
    """Yield rules that cannot be read before the take-off, or that the tree cannot keep."""
    found = [leaf for leaf in tree.leaves() if isinstance(leaf, Rules)]
    for leaf in found[1:]:
        message = f"the mission has its rules already, in '{found[0].path}': put all in one node"
        yield Fault(leaf, message, Rule.CHILDREN)
    for leaf in found[:1]:
        late = [port.name for port in leaf.ports if leaf.initial_value(port) is None]
        for name in late:
            message = (
                f"attribute '{name}': the rules are read before the take-off, when the reference "
                "has no value: write the value here, or in an entry of the SubTree"
            )
            yield Fault(leaf, message, Rule.ATTRIBUTE)
        if not late:
            yield from _unkept(tree, leaf)


def _unkept(tree: MissionTree, leaf: Rules) -> Iterator[Fault]:
    rules = leaf.stated()
    written = {key: each for each in tree.leaves() for key in each.writes}
    if rules.land_on is LandOn.NONE and FLIGHT_HEIGHT in written:
        message = (
            f"attribute 'land_on': 'none' says that the mission never takes off, but "
            f"'{written[FLIGHT_HEIGHT].name}' does: write where it may land, or leave that node out"
        )
        yield Fault(leaf, message, Rule.ATTRIBUTE)
    if rules.area is not None and ODOMETRY not in written:
        message = (
            f"attribute 'area': the drone keeps within it by board key '{ODOMETRY.name}', which no "
            f"leaf of the tree writes: add {ODOMETRY.writer}"
        )
        yield Fault(leaf, message, Rule.BOARD_KEY)


def _stated(tree: MissionTree) -> MissionRules | None:
    """Return the rules of a mission; None without any, or where a value is not known yet."""
    rules = next((leaf for leaf in tree.leaves() if isinstance(leaf, Rules)), None)
    if rules is None or any(rules.initial_value(port) is None for port in rules.ports):
        return None
    return rules.stated()


@in_missions
def _refused_by_leaves(tree: MissionTree) -> Iterator[Fault]:
    """Yield values of leaves that the rules exclude, such as a place outside the area."""
    if (rules := _stated(tree)) is not None:
        for leaf in tree.leaves():
            if (message := leaf.refuses(rules)) is not None:
                yield Fault(leaf, message, Rule.ATTRIBUTE)


@in_missions
def _ends_in_the_air(tree: MissionTree) -> Iterator[Fault]:
    """Yield a warning where no leaf takes off, or none lands."""
    starts = next((leaf for leaf in tree.leaves() if leaf.takes_off), None)
    mover = next((leaf for leaf in tree.leaves() if leaf.moves), None)
    rules = _stated(tree)
    stays = rules is not None and rules.land_on is LandOn.NONE
    if mover is not None and starts is None and not stays:
        message = "no leaf of the mission takes off: add TakeOff before this"
        yield Fault(mover, message, Rule.MISSION, WARNING)
    if starts is not None and not any(leaf.lands for leaf in tree.leaves()):
        message = "no leaf of the mission lands, so it ends in the air: add Land"
        yield Fault(starts, message, Rule.MISSION, WARNING)


# --- values that are missing ----------------------------------------------------------------------


@in_missions
def _unwritten_keys(tree: MissionTree) -> Iterator[Fault]:
    """Yield reads of keys which neither the runner nor a leaf of the tree writes."""
    written = {key.name for key in MISSION_KEYS if key.writer == _RUNNER}
    keys: dict[str, Key[Any]] = {key.name: key for key in MISSION_KEYS}
    for leaf in tree.leaves():
        written |= {key.name for key in leaf.writes}
        keys |= {key.name: key for key in leaf.reads}
        outputs = (leaf.reference(port) for port in leaf.ports if port.direction != "input")
        written |= {at.key for at in outputs if at is not None and at.on_board}
    for node in tree.nodes():
        for attribute, key in (*_keys_of_ports(node), *_keys_of_scripts(node)):
            if key not in written:
                writer = f": {keys[key].writer} writes it" if key in keys else ""
                message = (
                    f"attribute '{attribute}': no leaf of the tree writes board key '{key}'{writer}"
                )
                yield Fault(node, message, Rule.BOARD_KEY)


def _keys_of_ports(node: Node) -> Iterator[tuple[str, str]]:
    """Yield port and board key of the input ports that the file connects to the board."""
    for port in node.ports:
        at = node.reference(port)
        if at is not None and at.on_board and port.direction != "output" and is_named(port, at):
            yield port.name, at.key


def _keys_of_scripts(node: Node) -> Iterator[tuple[str, str]]:
    """Yield attribute and board key of the scripts that read one without asking `known(...)`."""
    for attribute, script in node.scripts():
        names = {part.name for part in script.parts if isinstance(part, Name)}
        at = {
            name[1:] if name.startswith("@") else node.variables.board_key(name)
            for name in names - script.asked_known
        }
        yield from ((attribute, key) for key in sorted(key for key in at if key is not None))


@in_missions
def _needed_keys(tree: MissionTree) -> Iterator[Fault]:
    """Yield leaves that cannot succeed, because no leaf writes a board key that they need."""
    written = {key for leaf in tree.leaves() for key in leaf.writes}
    for leaf in tree.leaves():
        for key in leaf.needed:
            if key not in written:
                message = (
                    f"it needs board key '{key.name}', which no leaf of the tree writes: add "
                    f"{key.writer}"
                )
                yield Fault(leaf, message, Rule.BOARD_KEY)


@in_missions
def _names_from_nowhere(tree: MissionTree) -> Iterator[Fault]:
    """Yield SetBlackboard nodes whose `output_key` is in braces, where nothing gives the name."""
    setters = [one for one in tree.nodes() if isinstance(one, SetBlackboard)]
    named = [(one, at) for one in setters if (at := one.reference(one.OUTPUT_KEY)) is not None]
    slots = Uses(tree).slots if named else {}
    for node, at in named:
        slot = slots.get(node.variables.location(at.key), Slot(tree.variables, "", given=True))
        if not slot.given and not any(write.creates for write in slot.writes):
            message = (
                f"attribute 'output_key': nothing sets variable '{at.key}', from which the name is "
                f'read: write output_key="{at.key}", without braces'
            )
            yield Fault(node, message, Rule.VARIABLE)


@in_missions
def _late_values(tree: MissionTree) -> Iterator[Fault]:
    """Yield ports that are read before the take-off, when their variable has no value."""
    for leaf in tree.leaves():
        for port in leaf.ports:
            at, is_early = leaf.reference(port), port.name == POLICY_PORT or port.at_setup
            if at is not None and is_early and leaf.initial_value(port) is None:
                message = (
                    f"attribute '{port.name}': its value is needed before the take-off, when {at} "
                    "has none: write the value here, or in an entry of the SubTree"
                )
                yield Fault(leaf, message, Rule.ATTRIBUTE)


@in_missions
def _early_reads(tree: MissionTree) -> Iterator[Fault]:
    """Yield reads of variables that may have no value yet."""
    for early in early_reads(tree):
        message = (
            f"attribute '{early.attribute}': variable '{early.name}' may have no value here: what "
            "sets it may run later, or not at all; give it a value in a Script before"
        )
        yield Fault(early.node, message, Rule.VARIABLE)


@in_missions
def _misfits(tree: MissionTree) -> Iterator[Fault]:
    """Yield values that a reader may not be able to use."""
    for odd in misfits(tree):
        yield Fault(odd.node, f"attribute '{odd.attribute}' {odd.message}", Rule.VARIABLE)
