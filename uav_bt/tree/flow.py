"""How variables pass through nodes: what each class states, for checks before the flight.

The check of early reads follows the first tick through a tree. It asks each node which variables
have a value after its answers, given those that have one before (`NodeFlow.variables_after`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

from uav_bt.tree.node_ports import NodePorts
from uav_bt.tree.port import Port, Reference
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


Follow = Callable[[Any, Known], After]
"""Returns the variables with a value after a node, given those before it."""


@dataclass(frozen=True)
class Written:
    """A variable that a node writes when it succeeds."""

    attribute: str
    name: str | None  # in the node's own tree; None: known in flight only
    kind: type = object  # of the value; object: unknown
    value: str | None = None  # where the file has it
    elements: tuple[str, ...] = ()  # the values, one after another, where the file has them
    copied: Reference | None = None  # whose value it is
    port: Port[Any] | None = None  # None: named by a text
    keeps_type: bool = False  # an existing variable keeps its type


class NodeFlow(NodePorts):
    """What a class of nodes states about variables; a new node overrides what differs."""

    children: list[Any]

    ticks_again: ClassVar[bool] = False  # ticks its children in several rounds
    ticks_together: ClassVar[bool] = False  # ticks several children in the same tick
    asks_first: ClassVar[bool] = False  # its first child is a condition, which must not be skipped

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Return the variables with a value after this node; nothing is assumed of its children."""
        for child in self.children:
            follow(child, known)
        return After(known, known, known)

    def variables_written(self) -> Iterator[Written]:
        """Yield the variables that the node writes: those at its output ports."""
        for port in self.ports:
            at = self.given_references.get(port.name)
            if port.direction != "input" and at is not None and not at.on_board:
                yield Written(port.name, at.key, port.type, port=port)

    def variables_removed(self) -> Iterator[str]:
        """Yield the names of the variables that the node removes."""
        return iter(())

    def needs_value(self, port: Port[Any]) -> bool:
        """Return whether the node fails where the variable at an input port has no value."""
        return port.type is not object


def both(one: Out, other: Out) -> Out:
    """Return the variables with a value after either of two answers."""
    if one is None or other is None:
        return one if other is None else other
    return one & other


def joined(*found: After) -> After:
    """Return the variables with a value after any one of several nodes."""
    end = After(None, None)
    for after in found:
        end = After(
            both(end.success, after.success),
            both(end.failure, after.failure),
            both(end.skipped, after.skipped),
        )
    return end


def answered(known: Known, answer: object) -> After:
    """Return the variables with a value after an answer, by its name; None: any answer."""
    return After(*(known if answer in {name, None} else None for name in _ANSWERS))


_ANSWERS = ("SUCCESS", "FAILURE", "SKIPPED")


def as_child(node: NodeFlow, follow: Follow, known: Known) -> After:
    """Follow the only child, whose answers are the node's."""
    return follow(node.children[0], known)


def in_order(children: Iterable[Any], follow: Follow, known: Known, *, falls_back: bool) -> After:
    """Follow children of which each runs after those before it have succeeded, or all failed."""
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
