"""Values that a file gives to ports of leaves: names that are not installed, values for caution."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

from uav_bt import plugins
from uav_bt.errors import InputError, UnknownNameError
from uav_bt.tree.loading.attributes import POLICY_PORT
from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.findings import WARNING, Finding, Rule
from uav_bt.tree.loading.models import PalettePort
from uav_bt.tree.loading.parameters import VAR
from uav_bt.tree.loading.replacements import Built
from uav_bt.tree.loading.uses import Use
from uav_bt.tree.nodes import SubTree
from uav_bt.tree.port import Port, port_text
from uav_bt.tree.script.parser import parse_text
from uav_bt.tree.scripted import ScriptedLeaf

# A port, a text that it is given, and a finding about it, whose message only names the attribute.
_Given = tuple[Port[Any], str, Finding]


def _given_texts(built: Built, document: Document) -> Iterator[_Given]:
    """Yield the texts of the input ports of leaves, also by entries and by values from outside.

    Left out are mocked leaves, ports of a palette, texts with placeholders, and ports that only the
    flight gives a value.
    """
    for leaf in built.tree.leaves():
        for port in () if isinstance(leaf, ScriptedLeaf) else leaf.ports:
            if (
                port.direction != "input"
                or isinstance(port, PalettePort)
                or port.check is parse_text
            ):
                continue
            own, at = Use(leaf, port.name), leaf.reference(port)
            if at is None:
                text = built.parts[leaf.path].given.get(port.name, port_text(port.default))
                yield port, text, _finding(built, own)
            elif not at.on_board and (slot := built.uses.place(leaf.variables, at.key)) is not None:
                for write in slot.values()[0]:
                    if write.use is None:
                        at_file = _outside(_finding(built, own), slot.name, document)
                        yield port, port_text(write.value), at_file
                    elif isinstance(write.use.node, SubTree):  # an entry
                        yield port, port_text(write.value), _finding(built, write.use)


def _finding(built: Built, use: Use) -> Finding:
    element = built.parts[use.node.path].element
    lead = f"attribute '{use.attribute}': "
    return Finding(str(element.path), element.at(use.attribute), lead, use.node.path)


def _outside(found: Finding, name: str, document: Document) -> Finding:
    """Return a finding about a variable that a caller sets, where its file has it."""
    place, lead = document.parameters.places.get((VAR, name)), f"variable '{name}': "
    if place is None:
        return replace(found, message=lead)
    return replace(found, message=lead, path=str(place.path), position=place.position)


def unknown_policies(built: Built, document: Document) -> Iterator[Finding]:
    """Yield the names of policies that are not registered; the flight shows those it makes up."""
    known = document.registry.policies
    for port, text, at in _given_texts(built, document) if known is not None else ():
        name = text.partition(":")[0]  # what follows is the policy's own business
        if port.name == POLICY_PORT and known is not None and name not in known:
            message = str(UnknownNameError("policy", name, known))
            yield replace(at, message=message, rule=Rule.NOT_INSTALLED)


def remarks(built: Built, document: Document) -> Iterator[Finding]:
    """Yield names that are not installed, and values that need caution."""
    for port, text, at in _given_texts(built, document):
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
