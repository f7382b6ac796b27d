"""What the engine's script parser up to release 4.8 refuses of a script, or reads in another way.

Release 4.9.0 has a parser written by hand (pull request 1099 of BehaviorTree.CPP); before, the
grammar in `scripting/operators.hpp` said what a script is. Where the two differ stands here, for
scripts that `parse_script` takes.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Final

from uav_bt.tree.script.parser import ASSIGNMENTS, NUMBERS, Token, number_of, tokenize

_ARITHMETIC: Final = frozenset({"+", "-", "*", "/"})
_BITS: Final = frozenset({"&", "|", "^", "~", "!"})
_GROUPS: Final = {
    **dict.fromkeys(_ARITHMETIC, "arithmetic"),
    **dict.fromkeys(_BITS, "bits"),
    "..": "texts",
}
_TOO_LARGE: Final = {"integer": 2**63, "real": math.inf}
_BRACKETS: Final = "put one of them in brackets"
_STARTS: Final = frozenset({"!", "~", "("})  # of an operand; a '-' after one is a subtraction


@dataclass(frozen=True)
class Objection:
    """What an older parser does not read as `parse_script` does."""

    problem: str
    cure: str
    mended: bool = True  # 4.9.0 is known to read it as `parse_script` does


@dataclass(frozen=True)
class Older:
    """How releases before 4.9.0 read a script.

    Attributes:
        refused: the first reason to refuse it, or None.
        differs: what they make something else of, or None.
    """

    refused: Objection | None = None
    differs: Objection | None = None


def read_before_4_9(source: str) -> Older:
    """Return how releases before 4.9.0 read a script.

    Args:
        source: a script that `parse_script` takes.
    """
    if source and not source.strip():
        return Older(
            refused=Objection("a script of nothing but blanks", "leave it empty", mended=False)
        )
    reader = _Reader(tokenize(source))
    try:
        reader.read()
    except _RefusedError as refused:
        return Older(refused=refused.objection)
    return Older(differs=reader.differs)


class _RefusedError(Exception):
    def __init__(self, token: Token, problem: str, cure: str, *, mended: bool = True) -> None:
        super().__init__(problem)
        self.objection = Objection(f"column {token.column}: {problem}", cure, mended)


class _Level:
    """What stands at one level of brackets, in one statement."""

    def __init__(self) -> None:
        self.group = ""
        self.asked = False  # has a '?'
        self.assigned = False
        self.either = False  # has a '||' since the last '?', ':' or assignment
        self.operand = False  # the last word ends an operand


class _Reader:
    def __init__(self, tokens: list[Token]) -> None:
        self._tokens = tokens
        self._at = 0
        self.differs: Objection | None = None

    def read(self) -> None:
        for token, after in itertools.pairwise(self._tokens):
            _check_word(token, after)
        self._level("end")

    def _level(self, end: str) -> None:
        """Read up to the word that closes the level, and that word."""
        level = _Level()
        while True:
            token = self._tokens[self._at]
            self._at += 1
            sign = token.text if token.kind == "operator" else ""
            if token.kind == "end" or (sign and sign == end):
                return
            if sign == ";":
                self._check_semicolon(token, level)
                level = _Level()
            elif level.operand and (not sign or sign in _STARTS):
                raise _RefusedError(token, "a statement without ';' before it", "write the ';'")
            elif not sign:
                level.operand = True
            else:
                self._operator(token, level)

    def _check_semicolon(self, token: Token, level: _Level) -> None:
        if not level.operand:
            raise _RefusedError(token, "a ';' that ends no statement", "leave it out")
        if self._tokens[self._at].kind == "end":
            raise _RefusedError(token, "a ';' at the end", "leave it out")

    def _operator(self, token: Token, level: _Level) -> None:
        sign = token.text
        level.operand = False
        if sign == "(":
            self._level(")")
            level.operand = True
        elif sign == "?":
            if level.asked:
                raise _RefusedError(token, "a '?' after another", _BRACKETS, mended=False)
            level.asked = True
            level.either = False
            self._level(":")
        elif sign in ASSIGNMENTS:
            if level.assigned:
                raise _RefusedError(token, "an assignment in another", _BRACKETS, mended=False)
            level.assigned = True
            level.either = False
        elif sign == "||":
            level.either = True
        elif sign == "&&" and level.either:
            problem = f"column {token.column}: '&&' binds as '||' does, from left to right"
            self.differs = Objection(problem, _BRACKETS, mended=False)
        elif sign in _GROUPS:
            self._check_group(token, level)

    def _check_group(self, token: Token, level: _Level) -> None:
        group = _GROUPS[token.text]
        level.group = level.group or group
        if group != level.group:
            problem = f"'{token.text}' in an expression of {level.group}"
            raise _RefusedError(token, problem, _BRACKETS, mended=False)


def _check_word(token: Token, after: Token) -> None:
    if token.kind == "name":
        value = "true" if token.text.startswith("true") else "false"
        if token.text.startswith(value) and token.text != value:
            raise _RefusedError(token, f"a name that begins with '{value}'", "rename it")
    elif token.kind == "text" and not token.text.isascii():
        problem = "a text with letters other than ASCII"
        raise _RefusedError(token, problem, "set the variable with <SetBlackboard>")
    elif token.kind in NUMBERS:
        glued = after.text == ".." and after.column == token.column + len(token.text)
        if glued:
            raise _RefusedError(after, "'..' right after a number", "put a blank between them")
        if number_of(token) >= _TOO_LARGE[token.kind]:
            problem, cure = "a number that is too large", "write a smaller one"
            raise _RefusedError(token, problem, cure, mended=False)
