"""Texts with placeholders: `{variable}` and `{@board_key}`, which a node fills in when it runs."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Final

from uav_bt.errors import UnknownValueError
from uav_bt.tree.script.expressions import Name
from uav_bt.tree.script.parser import Script
from uav_bt.tree.script.values import Environment, ScriptError

UNKNOWN: Final = "unknown"  # in place of a name that has no value, or an old one

_NAME: Final = re.compile(r"\{\s*(@?[A-Za-z_][A-Za-z0-9_.\-]*)\s*\}")


@lru_cache(maxsize=4096)  # loading a file meets each text several times
def parse_text(source: str) -> Script:
    """Return the names in a text with placeholders, as a script that reads them."""
    stray = re.search(r"[{}]", _NAME.sub("", source))
    if stray is not None:
        raise ScriptError(
            f"'{stray[0]}' belongs to no placeholder: write {{variable}} or {{@board_key}}"
        )
    return Script(source, tuple(map(Name, _NAME.findall(source))))


def fill_text(source: str, environment: Environment) -> str:
    """Return a text with the values of its placeholders. Reals have up to three decimal places."""

    def value(match: re.Match[str]) -> str:
        try:
            value = environment.read(match[1])
        except (ScriptError, UnknownValueError):
            return UNKNOWN
        return f"{value:.3f}".rstrip("0").rstrip(".") if isinstance(value, float) else str(value)

    return _NAME.sub(value, source)
