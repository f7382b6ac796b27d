"""Faults of a whole tree that would end its flight, each found by one function.

A new check is a function that yields faults, below `everywhere` or `in_missions`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from typing import Any, Final, NamedTuple

from uav_bt.board import FLIGHT_HEIGHT, MISSION_KEYS, ODOMETRY, PERCEIVED_KEYS, Key
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import load_lab
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.attributes import POLICY_PORT
from uav_bt.tree.loading.early_reads import early_reads
from uav_bt.tree.loading.findings import ERROR, WARNING, Finding, Position, Rule
from uav_bt.tree.loading.misfits import misfits
from uav_bt.tree.loading.uses import Uses, is_named
from uav_bt.tree.node import Node
from uav_bt.tree.nodes import LoopBool, LoopDouble, LoopInt, ReactiveSequence, SetBlackboard
from uav_bt.tree.rules import Rules
from uav_bt.tree.script.expressions import Name
from uav_bt.types.place import LandOn, MissionRules

_RUNNER: Final = "runner"  # the writer of the keys that every mission has


class Fault(NamedTuple):
    """What would end the flight, at a node."""

    node: Node
    message: str  # the mistake and the remedy
    rule: Rule
    severity: str = ERROR
    attribute: str = ""  # where the fault is; default: the node as a whole


_Check = Callable[[Uses], Iterator[Fault]]
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


def faults_of(uses: Uses) -> Iterator[Finding]:
    """Return the faults of a tree that is flown as it is."""
    checks = (*_EVERYWHERE, *_IN_MISSIONS)
    return findings_at(uses, (fault for check in checks for fault in check(uses)))


def faults_of_part(uses: Uses) -> Iterator[Finding]:
    """Return the faults that a tree has in every mission that uses it."""
    return findings_at(uses, (fault for check in _EVERYWHERE for fault in check(uses)))


def findings_at(uses: Uses, faults: Iterable[Fault]) -> Iterator[Finding]:
    """Yield faults with their places in the file."""
    for node, message, rule, severity, attribute in faults:
        place = uses.tree.places.get(node.path)
        path = uses.tree.path if place is None else place.path
        position = Position(1, 1) if place is None else place.at(attribute)
        yield Finding(str(path), position, message, node.path, severity, rule)


def refused_by_lab(uses: Uses, lab: Callable[[], Lab]) -> Iterator[Fault]:
    """Yield the leaves that cannot fly in a lab."""
    for leaf in uses.tree.leaves():
        if (message := leaf.refuses_lab(lab)) is not None:
            yield Fault(leaf, message, Rule.LAB)


# --- nodes with children --------------------------------------------------------------------------


@everywhere
def _loops_over_words(uses: Uses) -> Iterator[Fault]:
    """Yield loops over numbers or truth values whose queue is a board key that holds a text."""
    texts = {key.name for leaf in uses.tree.leaves() for key in leaf.writes if key.type is str}
    for node in uses.tree.nodes():
        if isinstance(node, LoopBool | LoopDouble | LoopInt):
            at = node.reference(node.QUEUE)
            if at is not None and at.on_board and at.key in texts:
                message = (
                    f"attribute 'queue': board key '{at.key}' holds a text, which may be no queue "
                    f"of {node.VALUE.type.__name__}: use LoopString"
                )
                yield Fault(node, message, Rule.BOARD_KEY)


@everywhere
def _two_movers(uses: Uses) -> Iterator[Fault]:
    """Yield nodes that tick children together of which two may ask for the same thing."""
    for node in (one for one in uses.tree.nodes() if one.ticks_together):
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
def _skipped_conditions(uses: Uses) -> Iterator[Fault]:
    """Yield conditions of nodes such as `IfThenElse` that may be skipped."""
    for node in (one for one in uses.tree.nodes() if one.asks_first):
        asked = node.children[0]
        for attribute in ("_skipIf", "_while"):
            if attribute in asked.condition_scripts:
                message = (
                    f"attribute '{attribute}': the condition of {node.node_id} must not be "
                    "skipped: ask this in a ScriptCondition before"
                )
                yield Fault(asked, message, Rule.CHILDREN)


@everywhere
def _begun_anew(uses: Uses) -> Iterator[Fault]:
    """Yield a warning for leaves that a ReactiveSequence begins anew while a later child runs."""
    for node in uses.tree.nodes():
        children = node.children if isinstance(node, ReactiveSequence) else []
        for child, later in pairwise(children):
            if isinstance(child, Leaf) and child.repeats:
                message = (
                    f"it begins anew in every tick and halts '{later.name}': a ReactiveSequence "
                    "has one child that runs, so write Sequence"
                )
                yield Fault(child, message, Rule.CHILDREN, WARNING)


# --- rules of a mission ---------------------------------------------------------------------------


@everywhere
def _rules(uses: Uses) -> Iterator[Fault]:
    """Yield rules that cannot be read before the take-off, or that the tree cannot keep."""
    found = [leaf for leaf in uses.tree.leaves() if isinstance(leaf, Rules)]
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
            yield from _unkept(uses, leaf)


def _unkept(uses: Uses, leaf: Rules) -> Iterator[Fault]:
    rules = leaf.stated()
    written = {key: each for each in uses.tree.leaves() for key in each.writes}
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


def _stated(uses: Uses) -> MissionRules | None:
    """Return the rules of a mission; None without any, or where a value is not known yet."""
    rules = next((leaf for leaf in uses.tree.leaves() if isinstance(leaf, Rules)), None)
    if rules is None or any(rules.initial_value(port) is None for port in rules.ports):
        return None
    return rules.stated()


@in_missions
def _refused_by_leaves(uses: Uses) -> Iterator[Fault]:
    """Yield values of leaves that the rules exclude, such as a place outside the area."""
    if (rules := _stated(uses)) is not None:
        for leaf in uses.tree.leaves():
            if (message := leaf.refuses(rules)) is not None:
                yield Fault(leaf, message, Rule.ATTRIBUTE)


@in_missions
def _refused_by_default_lab(uses: Uses) -> Iterator[Fault]:
    """Yield a warning for values that the default lab excludes, such as an unknown class."""
    for fault in refused_by_lab(uses, load_lab):
        message = f"in the default lab: {fault.message}; check with --lab for another one"
        yield fault._replace(message=message, severity=WARNING)


@in_missions
def _ends_in_the_air(uses: Uses) -> Iterator[Fault]:
    """Yield a warning where no leaf takes off, or none lands."""
    starts = next((leaf for leaf in uses.tree.leaves() if leaf.takes_off), None)
    mover = next((leaf for leaf in uses.tree.leaves() if leaf.moves), None)
    rules = _stated(uses)
    stays = rules is not None and rules.land_on is LandOn.NONE
    if mover is not None and starts is None and not stays:
        message = "no leaf of the mission takes off: add TakeOff before this"
        yield Fault(mover, message, Rule.MISSION, WARNING)
    if starts is not None and not any(leaf.lands for leaf in uses.tree.leaves()):
        message = "no leaf of the mission lands, so it ends in the air: add Land"
        yield Fault(starts, message, Rule.MISSION, WARNING)


# --- values that are missing ----------------------------------------------------------------------


@in_missions
def _unwritten_keys(uses: Uses) -> Iterator[Fault]:
    """Yield reads of keys which neither the runner nor a leaf of the tree writes."""
    written = {key.name for key in MISSION_KEYS if key.writer == _RUNNER}
    keys: dict[str, Key[Any]] = {key.name: key for key in MISSION_KEYS}
    for leaf in uses.tree.leaves():
        written |= {key.name for key in leaf.writes}
        keys |= {key.name: key for key in leaf.reads}
        outputs = (leaf.reference(port) for port in leaf.ports if port.direction != "input")
        written |= {at.key for at in outputs if at is not None and at.on_board}
    for node in uses.tree.nodes():
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
def _needed_keys(uses: Uses) -> Iterator[Fault]:
    """Yield leaves that cannot succeed, because no leaf writes a board key that they need."""
    written = {key for leaf in uses.tree.leaves() for key in leaf.writes}
    for leaf in uses.tree.leaves():
        for key in leaf.needs():
            if key not in written:
                or_all = ', or <SubTree ID="Perceive"/>' if key in PERCEIVED_KEYS else ""
                message = (
                    f"it needs board key '{key.name}', which no leaf of the tree writes: add "
                    f"{key.writer}{or_all}"
                )
                yield Fault(leaf, message, Rule.BOARD_KEY)


@in_missions
def _names_from_nowhere(uses: Uses) -> Iterator[Fault]:
    """Yield SetBlackboard nodes whose `output_key` is in braces, where nothing gives the name."""
    for node in uses.tree.nodes():
        at = node.reference(node.OUTPUT_KEY) if isinstance(node, SetBlackboard) else None
        is_name = at is not None and not at.on_board
        slot = uses.place(node.variables, at.key) if at and is_name else None
        if at and slot and not slot.given and not any(write.creates for write in slot.writes):
            message = (
                f"attribute 'output_key': nothing sets variable '{at.key}', from which the name is "
                f'read: write output_key="{at.key}", without braces'
            )
            yield Fault(node, message, Rule.VARIABLE)


@in_missions
def _late_values(uses: Uses) -> Iterator[Fault]:
    """Yield ports that are read before the take-off, when their variable has no value."""
    for leaf in uses.tree.leaves():
        for port in leaf.ports:
            at, is_early = leaf.reference(port), port.name == POLICY_PORT or port.at_setup
            if at is not None and is_early and leaf.initial_value(port) is None:
                message = (
                    f"attribute '{port.name}': its value is needed before the take-off, when {at} "
                    "has none: write the value here, or in an entry of the SubTree"
                )
                yield Fault(leaf, message, Rule.ATTRIBUTE)


@in_missions
def _early_reads(uses: Uses) -> Iterator[Fault]:
    """Yield reads of variables that may have no value yet."""
    for node, attribute, name in early_reads(uses):
        message = (
            f"attribute '{attribute}': variable '{name}' may have no value here: what sets it may "
            "run later, or not at all; give it a value in a Script before"
        )
        yield Fault(node, message, Rule.VARIABLE)


@everywhere
def _misfits(uses: Uses) -> Iterator[Fault]:
    """Yield values that a reader may not be able to use."""
    for node, attribute, message, _ in misfits(uses):
        told = f"attribute '{attribute}' {message}"
        yield Fault(node, told, Rule.VARIABLE, attribute=attribute)


@in_missions
def _unset(uses: Uses) -> Iterator[Fault]:
    """Yield reads of variables of the main tree that nothing sets."""
    for name, (node, attribute) in uses.unset().items():
        message = (
            f"attribute '{attribute}': nothing sets variable '{name}' of tree '{uses.tree.name}': "
            f"give it a value in a Script before, with --var {name}=VALUE, or in Python by "
            f"variables={{'{name}': ...}}"
        )
        yield Fault(node, message, Rule.VARIABLE, attribute=attribute)
