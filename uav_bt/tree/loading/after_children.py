"""Variables that have a value after a node with children, from those after each child."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

from uav_bt.tree.node import Node
from uav_bt.tree.nodes import BUILTIN_NODES
from uav_bt.tree.nodes.base import DecoratorNode, SubTree
from uav_bt.tree.variables import Variables

Variable = tuple[Variables, str]
"""A variable: the scope that holds it, and its name there."""

Known = frozenset[Variable]
Out = Known | None  # the variables with a value after an answer; None: it never answers so


@dataclass(frozen=True)
class After:
    """The variables with a value after each answer."""

    success: Out
    failure: Out
    skipped: Out = None


def both(one: Out, other: Out) -> Out:
    """Return the variables with a value after either of two answers."""
    if one is None or other is None:
        return one if other is None else other
    return one & other


_Follow = Callable[[Node, Known], After]
_Rule = Callable[[_Follow, Node, Known], After]
_LOOPS: Final = ("LoopBool", "LoopDouble", "LoopInt", "LoopString")
ROUNDS: Final = frozenset(
    {"Repeat", "RetryUntilSuccessful", "KeepRunningUntilFailure", *_LOOPS}
    | {"ReactiveSequence", "ReactiveFallback", "WhileDoElse"}
)
"""Nodes that tick their children in several rounds."""

_DECORATORS: Final = tuple(node for node in BUILTIN_NODES if issubclass(node, DecoratorNode))


def _ordered(follow: _Follow, node: Node, known: Known, *, children: Iterable[Node]) -> After:
    """Follow children of which each runs after those before it have succeeded, or all failed."""
    falls_back = "Fallback" in node.node_id
    reached: Out = known
    ended: Out = None
    skips = True
    for child in children:
        if reached is None:
            break
        after = follow(child, reached)
        ends, goes_on = after.failure, after.success
        if falls_back:
            ends, goes_on = goes_on, ends
        ended = both(ended, ends)
        reached = both(goes_on, after.skipped)
        skips = skips and after.skipped is not None
    skipped = known if skips else None
    return After(ended, reached, skipped) if falls_back else After(reached, ended, skipped)


def _in_order(follow: _Follow, node: Node, known: Known) -> After:
    return _ordered(follow, node, known, children=node.children)


def _try(follow: _Follow, node: Node, known: Known) -> After:
    after = _ordered(follow, node, known, children=node.children[:-1])
    follow(node.children[-1], known)  # also after a halt
    return after


def _parallel(follow: _Follow, node: Node, known: Known) -> After:
    ended, skips = known, True
    for child in node.children:
        after = follow(child, known)
        ended |= both(both(after.success, after.failure), after.skipped) or known
        skips = skips and after.skipped is not None
    every = node.literals.get("success_count", -1) == -1  # else some may still run
    return After(ended if every else known, known, known if skips else None)


def _choice(follow: _Follow, node: Node, known: Known) -> After:
    asked = follow(node.children[0], known)
    ways = (asked.success, asked.failure)
    chosen = [
        follow(child, known if way is None else way)
        for child, way in zip(node.children[1:], ways, strict=False)
    ]
    return _joined(chosen, After(None, asked.failure if len(chosen) == 1 else None))


def _switch(follow: _Follow, node: Node, known: Known) -> After:
    return _joined([follow(child, known) for child in node.children], After(None, None))


def _any_child(follow: _Follow, node: Node, known: Known) -> After:
    """Follow a node of another package, about which nothing is assumed."""
    for child in node.children:
        follow(child, known)
    return After(known, known, known)


def _joined(found: Iterable[After], first: After) -> After:
    for after in found:
        first = After(
            both(first.success, after.success),
            both(first.failure, after.failure),
            both(first.skipped, after.skipped),
        )
    return first


# --- decorators -----------------------------------------------------------------------------------


def _only_child(follow: _Follow, node: Node, known: Known) -> After:
    return follow(node.children[0], known)


def _inverter(follow: _Follow, node: Node, known: Known) -> After:
    after = _only_child(follow, node, known)
    return After(after.failure, after.success, after.skipped)


def _forced(follow: _Follow, node: Node, known: Known) -> After:
    after = _only_child(follow, node, known)
    ended = both(after.success, after.failure)
    succeeds = node.node_id == "ForceSuccess"
    return After(ended, None, after.skipped) if succeeds else After(None, ended, after.skipped)


def _otherwise(follow: _Follow, node: Node, known: Known) -> After:
    """Follow a decorator that answers by a port where it does not tick its child."""
    after = follow(node.children[0], known)
    answer = node.literals.get("else", node.literals.get("if_empty"))
    return _joined(
        [after],
        After(
            known if answer in {"SUCCESS", None} else None,
            known if answer in {"FAILURE", None} else None,
            known if answer in {"SKIPPED", None} else None,
        ),
    )


def _counted(follow: _Follow, node: Node, known: Known) -> After:
    after = _only_child(follow, node, known)
    count = node.literals.get(node.ports[0].name)
    if not count:  # zero, or known in flight only
        return _joined([after], After(known, known))
    if count < 0 and node.node_id == "Repeat":
        return After(None, after.failure, after.skipped)
    return after if count > 0 else After(after.success, None, after.skipped)


def _timeout(follow: _Follow, node: Node, known: Known) -> After:
    after = _only_child(follow, node, known)
    return After(after.success, both(after.failure, known), after.skipped)


def _until_failure(follow: _Follow, node: Node, known: Known) -> After:
    after = _only_child(follow, node, known)
    return After(None, after.failure, after.skipped)


def _unless_updated(follow: _Follow, node: Node, known: Known) -> After:
    after = _only_child(follow, node, known)
    return After(after.success, after.failure, known)


def _once(follow: _Follow, node: Node, known: Known) -> After:
    after = _only_child(follow, node, known)
    ended = both(after.success, after.failure)
    return After(after.success, after.failure, both(after.skipped, ended))


def after_children(follow: _Follow, node: Node, known: Known) -> After:
    """Return the variables with a value after a node with children.

    Args:
        follow: returns the variables with a value after a child, given those before it.
        node: of the format, or another one, about which nothing is assumed.
        known: the variables with a value when it ticks its first child.
    """
    rule = _RULES.get(node.node_id)
    if rule is None:
        rule = _only_child if isinstance(node, (SubTree, *_DECORATORS)) else _any_child
    return rule(follow, node, known)


_RULES: Final[dict[str, _Rule]] = {
    **dict.fromkeys(
        ("Sequence", "AsyncSequence", "ReactiveSequence", "SequenceWithMemory"), _in_order
    ),
    **dict.fromkeys(("Fallback", "AsyncFallback", "ReactiveFallback"), _in_order),
    **dict.fromkeys(("Parallel", "ParallelAll"), _parallel),
    **dict.fromkeys(("IfThenElse", "WhileDoElse"), _choice),
    **dict.fromkeys(("Switch2", "Switch3", "Switch4", "Switch5", "Switch6"), _switch),
    "TryCatch": _try,
    "Inverter": _inverter,
    **dict.fromkeys(("ForceSuccess", "ForceFailure"), _forced),
    **dict.fromkeys((*_LOOPS, "Precondition"), _otherwise),
    **dict.fromkeys(("Repeat", "RetryUntilSuccessful"), _counted),
    "SkipUnlessUpdated": _unless_updated,
    "RunOnce": _once,
    "Timeout": _timeout,
    "KeepRunningUntilFailure": _until_failure,
}
