"""The nodes that are to be made of a file: subtrees put in place, attributes found."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.document import autoremaps
from uav_bt.tree.loading.elements import node_id_of
from uav_bt.tree.loading.palette import PalettePort
from uav_bt.tree.loading.parameters import VAR, Parameters
from uav_bt.tree.loading.source import Element
from uav_bt.tree.node import Node
from uav_bt.tree.nodes import SubTree
from uav_bt.tree.port import Port, parse_reference, port_text
from uav_bt.tree.script import parse_text
from uav_bt.tree.scripted import Mock


@dataclass
class Plan:
    """A node to be made."""

    element: Element
    node: type[Node]
    name: str
    path: str
    attributes: dict[str, str]
    door: Plan | None  # the node that stands for the tree that this one is in; None: the main tree
    children: list[Plan] = field(default_factory=list)
    mock: Mock | None = None  # the leaf that takes its place

    def walk(self) -> Iterator[Plan]:
        """Iterate over this node and all below, parents first."""
        yield self
        for child in self.children:
            yield from child.walk()

    @property
    def mockable(self) -> type[Leaf | SubTree] | None:
        """The class of a leaf, or of a SubTree; None for other nodes."""
        return self.node if issubclass(self.node, (Leaf, SubTree)) else None

    @property
    def names(self) -> tuple[str, str, str]:
        """Names by which a caller may choose the node: its path, its name and its node's id."""
        is_subtree = issubclass(self.node, SubTree)
        return (
            self.path,
            self.name,
            self.element.attributes["ID"] if is_subtree else self.node.node_id,
        )

    def given(self, parameters: Parameters) -> Iterator[tuple[Port[Any], GivenValue]]:
        """Yield the input ports of the leaves here and below that have a text, with the text.

        The text may be the entry of a subtree that the leaf stands in, or the value of a variable
        that comes from outside. Leaves that are replaced by a script, ports of a palette, and texts
        with placeholders are left out.

        Args:
            parameters: values from outside.
        """
        for plan in self.walk():
            if not issubclass(plan.node, Leaf) or plan.mock is not None:
                continue
            for port in plan.node.ports:
                if isinstance(port, PalettePort) or port.check is parse_text:
                    continue
                if port.direction == "input":
                    value = plan._value(port.name, port_text(port.default), parameters)  # noqa: SLF001
                    if value is not None:
                        yield port, value

    def _value(self, name: str, default: str, outside: Parameters) -> GivenValue | None:
        """Return what gives an attribute its text; None where only the flight does."""
        text = self.attributes.get(name, default)
        reference = parse_reference(text, name)
        if reference is None:
            return GivenValue(self.element, name, self.path, text)
        door, key = self.door, reference.key
        if reference.on_board:
            return None
        if door is None:
            return self._from_outside(key, outside)
        if key in door.attributes or autoremaps(door.element):
            return door._value(key, f"{{{key}}}", outside)  # noqa: SLF001
        return None

    def _from_outside(self, variable: str, outside: Parameters) -> GivenValue | None:
        value = outside.variables.get(variable)
        if value is None:
            return None
        place = outside.places.get((VAR, variable))
        element = self.element
        if place is not None:
            element = replace(element, path=place.path, position=place.position, locate=dict)
        return GivenValue(element, variable, self.path, port_text(value), what="variable")


@dataclass(frozen=True)
class GivenValue:
    """A text that is given to a port, directly, as the entry of a subtree or by a variable."""

    element: Element  # that has the text
    attribute: str
    path: str  # of the node that has it
    text: str
    what: str = "attribute"  # or variable: its value comes from outside

    @property
    def lead(self) -> str:
        """How a message about it begins."""
        return f"{self.what} '{self.attribute}': "


def name_of(element: Element) -> str:
    """Return the name of a node: its attribute `name`, or else the id of the node or tree."""
    name = element.attributes.get("name")
    if name:
        return name
    is_subtree = element.tag == SubTree.node_id
    return element.attributes["ID"] if is_subtree else node_id_of(element)
