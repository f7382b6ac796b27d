"""Nodes that are made of a tree, as the loader sees them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from uav_bt.errors import InputError
from uav_bt.tree.node import Node
from uav_bt.tree.nodes.base import SubTree
from uav_bt.tree.placing import place_tree
from uav_bt.tree.port import port_text
from uav_bt.tree.variables import Variables


class ExpandedNode(SubTree):
    """A node that is made of a tree: its ports are the entries of that tree.

    A port that a tree file leaves out has its default, so the tree inside always finds a variable
    of the name of each input port. A truth value is 1 or 0 there, as scripts have them.

    Args:
        name: the instance's name; default: the node's id.
        child: the root of the tree.
        given: values of the ports, typed or as texts; a text in braces is a reference.

    Raises:
        InputError: a port is missing, unknown or has a value of another type, or a port that
            chooses the tree has a reference.
    """

    min_children = 0  # in a tree file
    max_children = 0

    variants: ClassVar[Mapping[tuple[str, str], str]] = {}

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        names = {port.name for port in cls.ports}
        for name, _ in cls.variants:
            if name not in names:
                raise TypeError(f"{cls.__qualname__}.variants: there is no port '{name}'")

    def __init__(self, name: str | None, child: Node, /, **given: object) -> None:
        super(SubTree, self).__init__(name, child, **given)  # its ports are the entries
        self.attributes = {}
        self._autoremap = False
        self.tree_id = self._chosen_tree()
        self._take_entries(self.entries_of({**self._literals, **self._given}))
        # A first place, which a tree replaces. A tree of py_trees does not.
        place_tree(self, self.name, Variables())

    @classmethod
    def tree_of(cls, given: Mapping[str, object]) -> str:
        """Return the ID of the tree that a node is made of.

        Args:
            given: values of the ports, typed or as texts; those that are missing have defaults.
        """
        defaults = {port.name: port.default for port in cls.ports}
        for (name, value), tree_id in cls.variants.items():
            if port_text(given.get(name, defaults[name])) == value:
                return tree_id
        return cls.node_id

    @classmethod
    def tree_ids(cls) -> tuple[str, ...]:
        """Return the IDs of all trees that a node of this class can be made of."""
        return (cls.node_id, *cls.variants.values())

    @classmethod
    def entries_of(cls, bound: Mapping[str, Any]) -> dict[str, str]:
        """Return the entries of the tree inside, as a SubTree has them in a tree file.

        Args:
            bound: values or references by port, as `bind_ports` returns them.
        """
        choosing = {name for name, _ in cls.variants}
        return {name: _entry(value) for name, value in bound.items() if name not in choosing}

    def rebind(self, given: Mapping[str, object]) -> None:
        """Replace what ports were given; to be done before the setup.

        Args:
            given: values by port, typed or as texts.

        Raises:
            InputError: a port is unknown, a value does not fit, or another tree is chosen.
        """
        super(SubTree, self).rebind(given)  # as every node with ports
        if self._chosen_tree() != self.tree_id:
            raise InputError(
                f"node '{self.name}' ({self.node_id}) is made of tree '{self.tree_id}' already: "
                f"give {', '.join(given)} where the node is made"
            )
        self._take_entries(self.entries_of({**self._literals, **self._given}))
        place_tree(self, self.path, self.variables)

    def _chosen_tree(self) -> str:
        for name, _ in self.variants:
            if name in self._given:
                raise InputError(f"node '{self.name}' ({self.node_id}): {literal_wanted(name)}")
        return self.tree_of(self._literals)


def literal_wanted(port: str) -> str:
    """Return the message for a reference at a port that chooses the tree."""
    return f"attribute '{port}' chooses the tree that the node is made of: expected a literal"


def _entry(value: object) -> str:
    return str(int(value)) if isinstance(value, bool) else port_text(value)
