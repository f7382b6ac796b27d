"""Texts that a file gives to ports of leaves: names that are not installed, values for caution."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

from uav_bt import plugins
from uav_bt.errors import InputError, UnknownNameError
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.attributes import POLICY_PORT
from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.findings import WARNING, Finding, Rule
from uav_bt.tree.loading.models import PalettePort
from uav_bt.tree.loading.parameters import VAR
from uav_bt.tree.loading.replacements import Built
from uav_bt.tree.loading.uses import Uses
from uav_bt.tree.mission_tree import Place
from uav_bt.tree.node import Node
from uav_bt.tree.port import Port, port_text
from uav_bt.tree.script import parse_text
from uav_bt.tree.scripted import ScriptedLeaf

# A port, the text that it is given, and a finding about it, whose message only names the attribute.
_Given = tuple[Port[Any], str, Finding]


def _given_texts(built: Built, document: Document, uses: Uses) -> Iterator[_Given]:
    """Yield the texts of the input ports of leaves, also by entries and by values from outside.

    Left out are mocked leaves, ports of a palette, texts with placeholders, and ports that only the
    flight gives a value.
    """
    for leaf in built.tree.leaves():
        for port in () if isinstance(leaf, ScriptedLeaf) else leaf.ports:
            is_plain = not isinstance(port, PalettePort) and port.check is not parse_text
            if port.direction == "input" and is_plain:
                yield from _texts_of(port, leaf, built, document, uses)


def _texts_of(
    port: Port[Any], leaf: Leaf, built: Built, document: Document, uses: Uses
) -> Iterator[_Given]:
    """Yield the text of a port, or the first value of the variable that it reads."""
    node: Node = leaf
    at, outside = leaf.reference(port), document.parameters
    name, place, what = port.name, None, "attribute"
    if at is None:
        text = built.parts[node.path].given.get(name, port_text(port.default))
    else:
        scope, name = leaf.variables.location(at.key)
        node = uses.doors.get(scope, leaf)
        if at.on_board or name in scope.board:
            return
        if scope in uses.doors and name in built.parts[node.path].given:
            text = built.parts[node.path].given[name]
        elif scope is built.tree.variables and name in outside.variables:
            while node.variables is not scope:
                node = uses.doors[node.variables]
            text, what = port_text(outside.variables[name]), "variable"
            place = outside.places.get((VAR, name))
        else:
            return
    element = built.parts[node.path].element
    where = place or Place(element.path, element.at(name))
    lead = f"{what} '{name}': "
    yield port, text, Finding(str(where.path), where.position, lead, node.path)


def unknown_policies(built: Built, document: Document, uses: Uses) -> Iterator[Finding]:
    """Yield the names of policies that are not registered; the flight shows those it makes up."""
    known = document.registry.policies
    for port, text, at in _given_texts(built, document, uses) if known is not None else ():
        name = text.partition(":")[0]  # what follows is the policy's own business
        if port.name == POLICY_PORT and known is not None and name not in known:
            message = str(UnknownNameError("policy", name, known))
            yield replace(at, message=message, rule=Rule.NOT_INSTALLED)


def remarks(built: Built, document: Document, uses: Uses) -> Iterator[Finding]:
    """Yield names that are not installed, and values that need caution."""
    for port, text, at in _given_texts(built, document, uses):
        look_up = port.look_up
        if port.name == POLICY_PORT:
            look_up = partial(plugins.look_up_policy, own=document.registry.factories)
        try:
            typed = port.convert(text)
        except ValueError:  # the first value of a variable that another one replaces
            continue
        if look_up is not None:
            try:
                look_up(typed)
            except InputError as error:
                yield replace(at, message=f"{at.message}{error}", rule=Rule.NOT_INSTALLED)
        odd = None if port.caution is None else port.caution(typed)
        if odd is not None:
            message = f"{at.message}{odd}"
            yield replace(at, message=message, rule=Rule.LIMIT, severity=WARNING)
