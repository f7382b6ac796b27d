"""Texts with placeholders: `{variable}` and `{@board_key}`, which a node fills in when it runs."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Final

from uav_bt.errors import UnknownValueError
from uav_bt.tree.script.expressions import Name
from uav_bt.tree.script.parser import Script
from uav_bt.tree.script.values import Environment, ScriptError, Value

UNKNOWN: Final = "unknown"
"""Text in place of a name that has no value, or an old one."""

_NAME: Final = re.compile(r"\{\s*(@?[A-Za-z_][A-Za-z0-9_.\-]*)\s*\}")
_DIGITS: Final = 3  # decimal places of reals, at most


@lru_cache(maxsize=4096)  # loading a file meets each text several times
def parse_text(source: str) -> Script:
    """Return the names in a text with placeholders, as a script that reads them.

    Raises:
        ScriptError: A brace belongs to no placeholder.
    """
    stray = re.search(r"[{}]", _NAME.sub("", source))
    if stray is not None:
        raise ScriptError(
            f"'{stray[0]}' belongs to no placeholder: write {{variable}} or {{@board_key}}"
        )
    return Script(source, tuple(map(Name, _NAME.findall(source))))


def fill_text(source: str, environment: Environment) -> str:
    """Return a text with the values of its placeholders. Reals have up to three decimal places.

    Args:
        source: Text with placeholders.
        environment: Variables and board that the names belong to.
    """
    return _NAME.sub(lambda match: _value(match[1], environment), source)


def _value(name: str, environment: Environment) -> str:
    try:
        value: Value = environment.read(name)
    except (ScriptError, UnknownValueError):
        return UNKNOWN
    if isinstance(value, float):
        return f"{value:.{_DIGITS}f}".rstrip("0").rstrip(".")
    return str(value)
