"""Built-in nodes that replace control nodes and decorators known only from a palette.

nodes:
PipelineSequence: Sequence
RateController: pass                                      # ticks its child, no more
RecoveryNode: {is: RetryUntilSuccessful, num_attempts: 3}
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, Final

from uav_bt.errors import ValueRangeError, did_you_mean
from uav_bt.tree.loading.palette import PaletteControl, PaletteDecorator
from uav_bt.tree.node import Node
from uav_bt.tree.node_ports import BOUND
from uav_bt.tree.nodes import (
    BUILTIN_NODES,
    Fallback,
    ForceFailure,
    RetryUntilSuccessful,
    Sequence,
)
from uav_bt.tree.nodes.base import ControlNode, DecoratorNode
from uav_bt.tree.port import Reference
from uav_bt.tree.registry import NodeRegistry
from uav_bt.tree.status import IDLE, RUNNING, Status

_UNCHANGED: Final = "pass"  # answers as its child does
_IS: Final = "is"


class _Pass(DecoratorNode):
    """Ticks its child, and answers as it does."""

    def update(self) -> Status:
        """Tick the child."""
        if self.node_status is IDLE:
            self.set_status(RUNNING)
        return self.child.execute_tick()


class _Inside(ControlNode):
    """A control node that ticks like a decorator.

    With several children, RetryUntilSuccessful tries the first and runs the others between two
    attempts.
    """

    decorator: type[DecoratorNode]

    def __init__(self, name: str | None, children: Iterable[Node] = (), /, **given: object) -> None:
        first, *others = children
        if others:
            steps = Sequence("recover", others)
            first = Fallback("attempt", [first, ForceFailure("between", steps)])
        own = {port.name for port in self.decorator.ports}
        values = {port.name: port.default for port in self.ports if port.name in own}
        bound: Any = given.get(BOUND, given)
        texts = {key: str(at) for key, at in bound.items() if isinstance(at, Reference)}
        inner = {key: texts.get(key, bound.get(key, value)) for key, value in values.items()}
        self._inner = self.decorator("inside", first, **inner)
        super().__init__(name, [self._inner], **given)

    def update(self) -> Status:
        """Tick the decorator."""
        if self.node_status is IDLE:
            self.set_status(RUNNING)
        return self._inner.execute_tick()


_STAND_INS: Final[dict[str, type[Node]]] = {
    _UNCHANGED: _Pass,
    **{
        node.node_id: node
        for node in BUILTIN_NODES
        if issubclass(node, (ControlNode, DecoratorNode)) and node.node_id != "SubTree"
    },
}


def with_stand_ins(registry: NodeRegistry, table: Mapping[str, object]) -> NodeRegistry:
    """Return a registry in which built-in nodes replace nodes of a palette.

    Args:
        registry: the registry with the palette's nodes.
        table: replacements, by the id of a palette's control node or decorator. An entry is `pass`,
            the id of a built-in node, or a mapping with that id as `is` and values of its ports.

    Raises:
        ValueRangeError: the palette has no such node, or the entry names no usable replacement.
    """
    chosen = {node_id: registry[node_id] for node_id in registry}
    for node_id, entry in table.items():
        known = [each for each in chosen if issubclass(chosen[each], _FOREIGN)]
        if node_id not in known:
            raise ValueRangeError(
                f"the palette has no control node or decorator '{node_id}'"
                f"{did_you_mean(node_id, known)}"
            )
        given = dict(entry) if isinstance(entry, Mapping) else {_IS: entry}
        chosen[node_id] = _stand_in(chosen[node_id], str(given.pop(_IS, "")), given)
    return registry.with_replaced(chosen)


_FOREIGN: Final = (PaletteControl, PaletteDecorator)


def without_stand_in(nodes: Iterable[Node]) -> list[str]:
    """Return the ids of a palette's control nodes and decorators that cannot be ticked."""
    return list(dict.fromkeys(node.node_id for node in nodes if isinstance(node, _FOREIGN)))


def _stand_in(foreign: type[Node], name: str, given: Mapping[str, Any]) -> type[Node]:
    base = _STAND_INS.get(name)
    if base is None:
        raise ValueRangeError(
            f"'{foreign.node_id}' cannot be '{name}': expected {', '.join(_STAND_INS)}"
            f"{did_you_mean(name, _STAND_INS)}"
        )
    ports = {port.name: port for port in (*foreign.ports, *base.ports)}
    for key, value in given.items():
        if key not in {port.name for port in base.ports}:
            raise ValueRangeError(f"'{name}' has no port '{key}'{did_you_mean(key, ports)}")
        ports[key] = replace(ports[key], default=str(value))
    missing = [port.name for port in base.ports if ports[port.name].required]
    theirs = {port.name for port in foreign.ports}
    if unknown := [key for key in missing if key not in theirs]:
        raise ValueRangeError(
            f"'{foreign.node_id}' as {name} needs {', '.join(unknown)}: write "
            f"{foreign.node_id}: {{is: {name}, {unknown[0]}: ...}}"
        )
    body: dict[str, Any] = {
        "__doc__": f"Stands for {foreign.node_id}.",
        "node_id": foreign.node_id,
        "ports": tuple(ports.values()),
    }
    bases: tuple[type[Node], ...] = (base,)
    if issubclass(foreign, PaletteControl) and issubclass(base, DecoratorNode):
        bases = (_Inside,)
        body |= {"decorator": base, "max_children": None if base is RetryUntilSuccessful else 1}
    return type(base.__name__, bases, body)
