"""Which nodes there are: the format's own and those that installed packages contribute."""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import InitVar, dataclass, field, replace
from typing import Any, Final

from py_trees.behaviour import Behaviour

from uav_bt import plugins
from uav_bt.board import MISSION_KEYS
from uav_bt.board.blackboard import Key
from uav_bt.errors import InputError, UnknownNameError
from uav_bt.tree.foreign import leaf_of
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.node import Node
from uav_bt.tree.nodes import BUILTIN_NODES

_log: Final = logging.getLogger(__name__)


@dataclass(eq=False, kw_only=True)
class NodeRegistry:
    """Node classes by their id: the format's own, and further nodes or py_trees behaviours."""

    nodes: InitVar[Iterable[type[Node | Behaviour]]] = field(default=(), kw_only=False)
    policies: Collection[str] | None = None  # leaf policies that a tree may name; None: any
    factories: Mapping[str, Any] = field(default_factory=dict)  # of policies of no package, by name
    faults: tuple[str, ...] = ()  # of installed packages, whose nodes are missing here
    enum_members: Mapping[str, int] = field(default_factory=dict)  # of a palette, for scripts
    foreign_board: bool = False  # trees of another engine name keys of a board that is not ours

    def __post_init__(self, nodes: Iterable[type[Node | Behaviour]]) -> None:
        self._nodes: dict[str, type[Node]] = {}
        for node in (*BUILTIN_NODES, *nodes):
            self._add(node)

    def __repr__(self) -> str:
        return f"<NodeRegistry: {len(self._nodes)} nodes>"

    @classmethod
    def installed(cls) -> NodeRegistry:
        """Return a registry with the nodes and policies of all installed packages.

        An entry point of the group `uav_bt.behaviours` names an iterable of node classes, or of
        py_trees behaviours. Unusable entries are left out: `faults` has them with the reasons, a
        warning is logged, and a tree file with such a node is refused with the reason. Two packages
        that use one name for different nodes raise an InputError.
        """
        registry = cls(policies=frozenset(plugins.names(plugins.POLICIES)))
        for name in plugins.names(plugins.BEHAVIOURS):
            try:
                nodes = _nodes_of(name)
            except InputError as error:
                registry.faults += (str(error),)
                continue
            for node in nodes:
                try:
                    registry._add(node)
                except InputError as error:
                    if getattr(node, "node_id", None) in registry:
                        raise  # whose node a tree would get is not to be guessed
                    registry.faults += (f"behaviours package '{name}': {error}",)
        for fault in registry.faults:
            _log.warning("Warning: %s", fault)
        return registry

    def with_nodes(self, *nodes: type[Node | Behaviour]) -> NodeRegistry:
        """Return a registry that has further nodes: `NodeRegistry.installed().with_nodes(Peek)`."""
        return replace(self, nodes=(*self._nodes.values(), *nodes))

    def with_policies(self, factories: Mapping[str, Any]) -> NodeRegistry:
        """Return a registry of the same nodes with further policies, or their classes, by name."""
        known = None if self.policies is None else {*self.policies, *factories}
        both = {**self.factories, **factories}
        return replace(self, nodes=self._nodes.values(), policies=known, factories=both)

    def with_any_policy(self) -> NodeRegistry:
        """Return a registry of the same nodes that accepts any policy's name, for benches."""
        return replace(self, nodes=self._nodes.values(), policies=None)

    def _add(self, node: type[Node | Behaviour]) -> None:
        if not (isinstance(node, type) and issubclass(node, Behaviour)):
            raise InputError(f"expected a node class to register, got {node!r}")
        if not issubclass(node, Node):
            node = leaf_of(node)
        known = self._nodes.setdefault(node.node_id, node)
        if known is not node:
            first, second = (f"{one.__module__}.{one.__qualname__}" for one in (known, node))
            raise InputError(
                f"node '{node.node_id}' is registered twice: by {first} and by {second}; set "
                "another node_id on one of them"
            )

    def __getitem__(self, node_id: str) -> type[Node]:
        """Return a node class."""
        if node_id not in self._nodes:
            raise UnknownNameError("node", node_id, self._nodes)
        return self._nodes[node_id]

    def get(self, node_id: str) -> type[Node] | None:
        """Return a node class; None for an unknown id."""
        return self._nodes.get(node_id)

    def __contains__(self, node_id: object) -> bool:
        """Return whether a node of that id is known."""
        return node_id in self._nodes

    def __iter__(self) -> Iterator[str]:
        """Iterate over all ids, in alphabetical order."""
        return iter(sorted(self._nodes))

    @property
    def board_keys(self) -> dict[str, Key[object]]:
        """The mission keys and those that registered leaves declare, by name."""
        keys: dict[str, Key[object]] = {key.name: key for key in MISSION_KEYS}
        for node in self._nodes.values():
            if issubclass(node, Leaf):
                for key in (*node.reads, *node.writes):
                    keys.setdefault(key.name, key)
        return keys


def _nodes_of(name: str) -> tuple[type[Node | Behaviour], ...]:
    """Return what an entry point contributes."""
    loaded = plugins.load(plugins.BEHAVIOURS, name)
    if not isinstance(loaded, Iterable) or isinstance(loaded, str):
        raise InputError(
            f"entry point '{name}' of group '{plugins.BEHAVIOURS}' must name an iterable "
            f"of node classes, got {type(loaded).__name__}"
        )
    return tuple(loaded)
