"""Which nodes there are: the format's own and those that installed packages contribute."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping
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


class NodeRegistry:
    """Node classes by their id. Holds the format's own from the start.

    Args:
        nodes: further classes: nodes, or plain py_trees behaviours, which become leaf classes.
        policies: names of the leaf policies that a tree file may name; None: any.

    Raises:
        InputError: a class is neither, its id is taken, or an argument cannot be a port.
    """

    def __init__(
        self, nodes: Iterable[type[Node | Behaviour]] = (), *, policies: Iterable[str] | None = None
    ) -> None:
        self.policies = None if policies is None else frozenset(policies)
        self.factories: dict[str, Any] = {}  # of policies that no package registers, by name
        self.faults: tuple[str, ...] = ()  # of installed packages, whose nodes are missing here
        self.enum_members: dict[str, int] = {}  # of a palette's enumerations, for scripts
        self.foreign_board = False  # trees of another engine name keys of a board that is not ours
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
        warning is logged, and a tree file with such a node is refused with the reason.

        Raises:
            InputError: two packages use one name for different nodes.
        """
        registry = cls(policies=plugins.names(plugins.POLICIES))
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
        """Return a registry that has further nodes: `NodeRegistry.installed().with_nodes(Peek)`.

        Args:
            nodes: node classes, or plain py_trees behaviours, which become leaf classes.

        Raises:
            InputError: it is neither, its id is taken, or an argument cannot be a port.
        """
        return self._copy((*self._nodes.values(), *nodes), self.policies)

    def with_replaced(self, nodes: Mapping[str, type[Node]]) -> NodeRegistry:
        """Return a registry that has other classes for nodes of these ids."""
        return self._copy({**self._nodes, **nodes}.values(), self.policies)

    def with_policies(self, factories: Mapping[str, Any]) -> NodeRegistry:
        """Return a registry of the same nodes that has further policies.

        Args:
            factories: classes of policies, or policies, by the names that tree files give them.
        """
        known = None if self.policies is None else self.policies.union(factories)
        registry = self._copy(self._nodes.values(), known)
        registry.factories.update(factories)
        return registry

    def with_any_policy(self) -> NodeRegistry:
        """Return a registry of the same nodes that accepts any policy's name, for benches."""
        return self._copy(self._nodes.values(), None)

    def _copy(
        self, nodes: Iterable[type[Node | Behaviour]], policies: Iterable[str] | None
    ) -> NodeRegistry:
        registry = NodeRegistry(nodes, policies=policies)
        registry.faults = self.faults
        registry.factories = dict(self.factories)
        registry.foreign_board = self.foreign_board
        registry.enum_members = dict(self.enum_members)
        return registry

    def _add(self, node: type[Node | Behaviour]) -> None:
        if not (isinstance(node, type) and issubclass(node, Behaviour)):
            raise InputError(f"expected a node class to register, got {node!r}")
        if not issubclass(node, Node):
            node = leaf_of(node)
        known = self._nodes.setdefault(node.node_id, node)
        if known is not node:
            raise InputError(
                f"node '{node.node_id}' is registered twice: by {_origin(known)} and by "
                f"{_origin(node)}; set another node_id on one of them"
            )

    def __getitem__(self, node_id: str) -> type[Node]:
        """Return a node class.

        Raises:
            UnknownNameError: no such node is registered.
        """
        try:
            return self._nodes[node_id]
        except KeyError:
            raise UnknownNameError("node", node_id, self._nodes) from None

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
    """Return what an entry point contributes.

    Raises:
        InputError: it cannot be imported, or is not iterable.
    """
    loaded = plugins.load(plugins.BEHAVIOURS, name)
    if not isinstance(loaded, Iterable) or isinstance(loaded, str):
        raise InputError(
            f"entry point '{name}' of group '{plugins.BEHAVIOURS}' must name an iterable "
            f"of node classes, got {type(loaded).__name__}"
        )
    return tuple(loaded)


def _origin(node: type[Node]) -> str:
    return f"{node.__module__}.{node.__qualname__}"
