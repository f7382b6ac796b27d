"""Checks of the values that variables of the main tree get from outside."""

from __future__ import annotations

from collections.abc import Iterator

from uav_bt.errors import did_you_mean
from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.findings import ERROR, WARNING, Findings, Position, Rule
from uav_bt.tree.loading.parameters import VAR, Plain
from uav_bt.tree.loading.scopes import Scope, Slot
from uav_bt.tree.loading.variable_uses import VariableUses
from uav_bt.tree.mission_tree import Place


def check_given_variables(document: Document, findings: Findings) -> None:
    """Add a finding for each value that no node can take, and for each that may be lost.

    Args:
        document: the file; its main tree is known.
        findings: collects the findings.
    """
    given = document.parameters.variables
    # The scope of the main tree is the first.
    scope = next(VariableUses(document).find([document.main]), None) if given else None
    if scope is None:
        return
    slots = {slot.name: slot for slot in scope.slots()}
    for name, value in given.items():
        place = document.parameters.places.get((VAR, name), Place(document.path, Position(1, 1)))
        for message, severity in _faults(name, value, slots[name], scope):
            findings.add(place.path, place.position, message, severity=severity, rule=Rule.VARIABLE)


def _faults(name: str, value: Plain, slot: Slot, scope: Scope) -> Iterator[tuple[str, str]]:
    """Yield the faults of a variable's value, each with a severity."""
    if name not in scope.touched and not slot.obscure:
        hint = did_you_mean(name, scope.touched)
        yield f"no node uses a variable '{name}' of tree '{scope.tree_id}'{hint}", ERROR
    for read in slot.reads:
        try:
            if read.port is not None:
                read.port.read(value)
        except ValueError as error:
            yield f"variable '{name}': {error}; {read.use} reads it", ERROR
    for write in slot.writes:
        if write.creates:
            message = f"variable '{name}': {write.use} sets it, too, and replaces this value"
            yield message, WARNING
