"""Attributes of one node of a file: ports bound, scripts and board keys checked."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from typing import Any, Final, Protocol

from uav_bt.clock import TIME_LIMIT_S
from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.findings import ERROR, WARNING, Rule
from uav_bt.tree.port import (
    ASKED,
    CONDITION_ATTRIBUTES,
    Port,
    bind_ports,
    parse_reference,
)
from uav_bt.tree.script import SCRIPTS, Script, ScriptError, parse_question

POLICY_PORT: Final = "policy"  # by this name a leaf declares the port that names its leaf policy
_VARIABLE: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_.\-]*")
# Users write right angles and their parts in radians, such as 1.047 for 60 degrees.
_STEP_RAD: Final = math.pi / 12
_STEP_SHARE: Final = 0.01  # largest relative distance from a multiple of the step; chosen
_LEAST_MSEC: Final = 10  # a shorter time is less than a tick and probably in seconds; chosen
_TIME_LIMIT: Final = "time_limit_s"  # a port that states the limit is not measured by it


class Note(Protocol):
    """Takes a fault of a node's attribute."""

    def __call__(
        self, message: str, attribute: str, rule: Rule = Rule.ATTRIBUTE, severity: str = ERROR
    ) -> None:
        """Add it to the findings."""


class Attributes:
    """Checks attributes, of which each fault goes to a `Note`."""

    def __init__(self, document: Document) -> None:
        self._members = document.enum_members

    def bound(
        self, ports: Iterable[Port[Any]], given: Mapping[str, str], note: Note
    ) -> dict[str, Any] | None:
        """Return the values and references of ports; None where one is wrong."""
        ports = list(ports)
        bound, wrong = bind_ports(ports, dict(given))
        scripts = {port.name for port in ports if port.check in SCRIPTS}
        for name, message in wrong.items():
            note(message, name, Rule.SCRIPT if name in scripts else Rule.ATTRIBUTE)
        for port in ports:
            value = bound.get(port.name)
            if (script := port.script(value)) is not None:
                self._check_script(script, port.name, note, asked=port.check is parse_question)
            elif port.name in given and (doubt := _unit_doubt(port, value)) is not None:
                note(f"attribute '{port.name}': {doubt}", port.name, Rule.UNIT, WARNING)
        return None if wrong else bound

    def conditions(self, given: Mapping[str, str], note: Note) -> dict[str, str]:
        """Return the conditions among attributes, without those that cannot be parsed."""
        good = {name: text for name, text in given.items() if name in CONDITION_ATTRIBUTES}
        for name, text in [*good.items()]:
            try:
                self._check_script(parse_question(text), name, note, asked=name in ASKED)
            except ScriptError as error:
                note(f"attribute '{name}': {error}", name, Rule.SCRIPT)
                del good[name]
        return good

    def entries(self, given: Mapping[str, str], note: Note) -> dict[str, str]:
        """Return the entries of a SubTree among attributes."""
        good = {name: text for name, text in given.items() if name not in CONDITION_ATTRIBUTES}
        for name, text in [*good.items()]:
            if not _VARIABLE.fullmatch(name):
                note(f"'{name}' cannot be a variable's name", name)
            try:
                parse_reference(text, name)
            except ValueError as error:
                note(f"attribute '{name}': {error}", name)
                good[name] = ""
        return good

    def _check_script(self, script: Script, name: str, note: Note, *, asked: bool) -> None:
        fault = script.fault(self._members, asked=asked)
        lead = f"attribute '{name}': "
        if fault is not None:
            note(f"{lead}the script always fails: {fault}", name, Rule.SCRIPT)
        for odd in script.oddities:
            note(f"{lead}{odd}", name, Rule.SCRIPT, WARNING)


def _unit_doubt(port: Port[Any], value: object) -> str | None:
    """Return why a literal was probably written in another unit than the port's, if it was."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    if _has_unit(port, "degrees", "deg"):
        return _radians(value)
    lasts = _has_unit(port, "seconds", "s") and port.name != _TIME_LIMIT
    if lasts and value > TIME_LIMIT_S:
        return (
            f"{value:g} s is longer than a mission, whose time limit is {TIME_LIMIT_S:g} s unless "
            "its Rules or the flight's options raise it"
        )
    if _has_unit(port, "msec", "msec", "ms") and 0 < value < _LEAST_MSEC:
        return f"{value:g} ms is shorter than a tick; for {value:g} s write {1000 * value:g}"
    return None


def _has_unit(port: Port[Any], name: str, *endings: str) -> bool:
    return port.name == name or port.name.endswith(tuple(f"_{ending}" for ending in endings))


def _radians(value: float) -> str | None:
    if not 0.0 < abs(value) <= math.tau or (2 * value).is_integer():
        return None
    steps = round(abs(value) / _STEP_RAD)
    if abs(abs(value) - steps * _STEP_RAD) > _STEP_SHARE * steps * _STEP_RAD:
        return None
    meant_deg = math.copysign(15 * steps, value)
    return f"{value:g} degrees looks like radians; for {meant_deg:g} degrees write {meant_deg:g}"
