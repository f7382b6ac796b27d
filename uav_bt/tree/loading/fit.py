"""Which types go into which ports, checked before anything flies."""

from __future__ import annotations

import inspect
from typing import Any, Final

from uav_bt.board.blackboard import Key
from uav_bt.tree.port import Port

_NUMBERS: Final = (int, float)
_TEXTUAL: Final = (str, int, float, bool)  # what `Port.read` makes of a text


def key_fits(port: Port[Any], key: Key[Any]) -> bool:
    """Return whether a port can be connected to a board key.

    Args:
        port: of a node.
        key: of the mission board.
    """
    if port.direction == "input":
        return issubclass(key.type, port.type) or (port.type is float and key.type is int)
    return issubclass(port.type, key.type) or (key.type is float and port.type is int)


def may_convert(kind: type, wanted: type) -> bool:
    """Return False when a value of one type can never be read as another; see `Port.read`.

    Args:
        kind: the type of the value.
        wanted: the type of the port.
    """
    if object in {kind, wanted}:
        return True
    if kind is str:
        return wanted in _TEXTUAL
    if kind is bool:
        return issubclass(bool, wanted) and wanted not in _NUMBERS
    if kind in _NUMBERS and wanted in _TEXTUAL:
        return True
    return related(kind, wanted)


def related(kind: type, other: type) -> bool:
    """Return whether a value declared as one type may be an instance of the other, too."""
    return (
        issubclass(kind, other)
        or issubclass(other, kind)
        or any(
            inspect.isabstract(one) or getattr(one, "_is_protocol", False) for one in (kind, other)
        )
    )
