"""Texts that a file gives to ports of leaves: names that are not installed, values for caution."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

from uav_bt import plugins
from uav_bt.errors import InputError, UnknownNameError
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.attributes import POLICY_PORT
from uav_bt.tree.loading.build import Built
from uav_bt.tree.loading.document import Document, autoremaps
from uav_bt.tree.loading.findings import WARNING, Finding, Rule
from uav_bt.tree.loading.models import PalettePort
from uav_bt.tree.loading.parameters import VAR
from uav_bt.tree.loading.source import Element
from uav_bt.tree.nodes import SubTree
from uav_bt.tree.port import Port, parse_reference, port_text
from uav_bt.tree.script import parse_text
from uav_bt.tree.scripted import ScriptedLeaf


class _Given(NamedTuple):
    """A text that is given to a port, directly, as the entry of a subtree or by a variable."""

    port: Port[Any]
    element: Element  # that has the text
    attribute: str
    path: str  # of the node that has it
    text: str
    what: str = "attribute"  # or variable: its value comes from outside

    def finding(self, message: str, rule: Rule, **severity: str) -> Finding:
        """Return a finding about it."""
        where = self.element.at(self.attribute)
        return Finding(str(self.element.path), where, message, self.path, rule=rule, **severity)


def _given_texts(built: Built, document: Document) -> Iterator[_Given]:
    """Yield the texts of the input ports of leaves, also by entries and by values from outside.

    Left out are mocked leaves, ports of a palette, texts with placeholders, and ports that only the
    flight gives a value.
    """
    for leaf in built.tree.leaves():
        for port in () if isinstance(leaf, ScriptedLeaf) else leaf.ports:
            is_plain = not isinstance(port, PalettePort) and port.check is not parse_text
            if port.direction == "input" and is_plain:
                given = _given(port, leaf, built, document)
                yield from () if given is None else (given,)


def _given(port: Port[Any], leaf: Leaf, built: Built, document: Document) -> _Given | None:
    """Return the text that a port has from the file or from outside; None without one."""
    node: Any = leaf
    name, text = port.name, port_text(port.default)
    while True:
        part = built.parts[node.path]
        text = part.given.get(name, text)
        at = parse_reference(text, name)
        if at is None:
            return _Given(port, part.element, name, node.path, text)
        door = node.parent
        while door is not None and not isinstance(door, SubTree):
            door = door.parent
        if door is None or at.on_board:
            break
        outer = built.parts[door.path]
        if at.key not in outer.given and not autoremaps(outer.element):
            return None
        node, name, text = door, at.key, f"{{{at.key}}}"
    parameters = document.parameters
    if at.on_board or at.key not in parameters.variables:
        return None
    element, place = part.element, parameters.places.get((VAR, at.key))
    if place is not None:
        element = replace(element, path=place.path, position=place.position, locate=dict)
    value = port_text(parameters.variables[at.key])
    return _Given(port, element, at.key, node.path, value, what="variable")


def unknown_policies(built: Built, document: Document) -> Iterator[Finding]:
    """Yield the names of policies that are not registered; the flight shows those it makes up."""
    known = document.registry.policies
    for given in _given_texts(built, document) if known is not None else ():
        name = given.text.partition(":")[0]  # what follows is the policy's own business
        if given.port.name == POLICY_PORT and known is not None and name not in known:
            message = str(UnknownNameError("policy", name, known))
            yield given.finding(message, Rule.NOT_INSTALLED)


def remarks(built: Built, document: Document) -> Iterator[Finding]:
    """Yield names that are not installed, and values that need caution."""
    for given in _given_texts(built, document):
        port, look_up = given.port, given.port.look_up
        if port.name == POLICY_PORT:
            look_up = partial(plugins.look_up_policy, own=document.registry.factories)
        try:
            typed = port.convert(given.text)
        except ValueError:  # the first value of a variable that another one replaces
            continue
        lead = f"{given.what} '{given.attribute}': "
        if look_up is not None:
            try:
                look_up(typed)
            except InputError as error:
                yield given.finding(f"{lead}{error}", Rule.NOT_INSTALLED)
        odd = None if port.caution is None else port.caution(typed)
        if odd is not None:
            yield given.finding(f"{lead}{odd}", Rule.LIMIT, severity=WARNING)
