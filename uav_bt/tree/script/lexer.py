"""From a script's text to its words."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from uav_bt.tree.script.values import ScriptError

MAX_SCRIPT: Final = 4_000  # characters; a script in an attribute has some dozens

# Two characters first, so that the longer operator is found.
_OPERATOR: Final = r"[:+\-*/=!<>]=|&&|\|\||\.\.|[=<>+\-*/&|^~!?:();]"
_TOKEN: Final = re.compile(
    r"(?P<real>[0-9]+(?:\.[0-9]+(?:[eE][+-]?[0-9]+)?|[eE][+-]?[0-9]+))"
    r"|(?P<integer>0[xX][0-9A-Fa-f]+|[0-9]+)"
    r"|(?P<text>'[^'\n]*'|\"[^\"\n]*\")"
    r"|(?P<name>[@A-Za-z_]\w*)"
    rf"|(?P<operator>{_OPERATOR})"
    r"|(?P<space>\s+)"
)
_BEFORE_A_NAME: Final = frozenset({"real", "integer"})


@dataclass(frozen=True)
class Token:
    """A word of a script."""

    kind: str  # real, integer, text, name, operator or end
    text: str
    column: int  # in the script, from 1


def tokenize(source: str) -> list[Token]:
    """Return the words of a script; the last one is of kind `end`.

    Raises:
        ScriptError: something in it is no word, or it is too long.
    """
    if len(source) > MAX_SCRIPT:
        raise ScriptError(f"the script is longer than {MAX_SCRIPT} characters")
    tokens: list[Token] = []
    at = 0
    while at < len(source):
        match = _TOKEN.match(source, at)
        if match is None or match.lastgroup is None:
            raise ScriptError(f"column {at + 1}: unexpected '{source[at]}'")
        if match.lastgroup != "space":
            glued = tokens and tokens[-1].column - 1 + len(tokens[-1].text) == at
            if glued and match.lastgroup == "name" and tokens[-1].kind in _BEFORE_A_NAME:
                raise ScriptError(f"column {at + 1}: '{tokens[-1].text}{match[0]}' is no number")
            tokens.append(Token(match.lastgroup, match[0], at + 1))
        at = match.end()
    return [*tokens, Token("end", "the end", len(source) + 1)]
