"""From a script's text to expressions: an operator-precedence parser.

Weakest to strongest: assignment, `? :`, `||`, `&&`, comparisons (which chain), `| ^`, `&`,
`+ - ..`, `* /`, then `- ! ~` before an operand.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Final, NamedTuple

from uav_bt.errors import UnknownValueError
from uav_bt.tree.script.expressions import (
    COMPARISONS,
    Assignment,
    Expression,
    Known,
    Literal,
    Name,
    Op,
    certain_parts,
    is_constant,
    walk,
)
from uav_bt.tree.script.values import TRUTH_WORDS, Environment, ScriptError, Value, truth
from uav_bt.tree.variables import Variables

_MAX_SCRIPT: Final = 4_000  # characters; a script in an attribute has some dozens
_MAX_NESTING: Final = 40  # parentheses inside parentheses, and operators on operators
_MAX_OPERATORS: Final = 200  # in one script; each may be a level of the expression
_ASSIGNMENTS: Final = (":=", "=", "+=", "-=", "*=", "/=")
_LEVELS: Final = (("||",), ("&&",), tuple(COMPARISONS), ("|", "^"), ("&",), ("+", "-", ".."), "*/")
_STRENGTH: Final = {sign: level for level, signs in enumerate(_LEVELS) for sign in signs}
_TOKEN: Final = re.compile(
    r"(?P<real>[0-9]+(?:\.[0-9]+(?:[eE][+-]?[0-9]+)?|[eE][+-]?[0-9]+)(?![\w@]))"
    r"|(?P<integer>(?:0[xX][0-9A-Fa-f]+|[0-9]+)(?![\w@]))"
    r"|(?P<text>'[^'\n]*'|\"[^\"\n]*\")"
    r"|(?P<name>[@A-Za-z_]\w*)"
    # Two characters first, so that the longer operator is found.
    r"|(?P<operator>[:+\-*/=!<>]=|&&|\|\||\.\.|[=<>+\-*/&|^~!?:(),;])"
    r"|(?P<space>\s+)"
)
UNKNOWN: Final = "unknown"  # in place of a name that has no value, or an old one
_PLACEHOLDER: Final = re.compile(r"\{\s*(@?[A-Za-z_][A-Za-z0-9_.\-]*)\s*\}")


@dataclass(frozen=True)
class Script:
    """A parsed script."""

    source: str
    statements: tuple[Expression, ...]
    oddities: tuple[str, ...] = ()  # what runs, and is not as it should be written

    def run(self, environment: Environment) -> Value:
        """Run all statements and return the value of the last one."""
        result: Value = 0
        try:
            for statement in self.statements:
                result = statement.evaluate(environment)
        except UnknownValueError as error:
            raise UnknownValueError(f"script '{self.source}': {error}") from error
        except (ScriptError, OverflowError) as error:
            raise ScriptError(f"script '{self.source}': {error}") from error
        return result

    @cached_property
    def parts(self) -> tuple[Expression, ...]:
        """All parts."""
        return tuple(part for statement in self.statements for part in walk(statement))

    @cached_property
    def certain(self) -> tuple[Expression, ...]:
        """The parts that every run evaluates."""
        return tuple(part for statement in self.statements for part in certain_parts(statement))

    @cached_property
    def asked_known(self) -> frozenset[str]:
        """The names that `known(...)` asks about, board keys with their `@`."""
        return frozenset(part.name for part in self.parts if isinstance(part, Known))

    @property
    def board_writes(self) -> tuple[str, ...]:
        """The board keys that assignments name, without the `@`."""
        written = [part.name for part in self.parts if isinstance(part, Assignment)]
        return tuple(name[1:] for name in written if name.startswith("@"))

    def fault(self, members: Mapping[str, int], *, asked: bool) -> str | None:
        """Return why every run fails, whatever the variables hold; None when a run may work.

        `members` are those of enumerations; `asked`: the last value must be true or false.
        """
        variables = Variables()
        variables.enum_members.update(members)
        nothing = Environment(variables)
        try:
            for part in filter(is_constant, self.certain):
                part.evaluate(nothing)
            if asked and is_constant(self.statements[-1]):
                truth(self.statements[-1].evaluate(nothing))
        except (ScriptError, OverflowError) as error:
            return str(error)
        return None


@lru_cache(maxsize=4096)  # loading a file meets each script several times
def parse_script(source: str) -> Script:
    """Parse a script; the message of a ScriptError has the column and the expected word."""
    tokens = _tokens(source)
    parser = _Parser(tokens)
    statements = tuple(parser.statements())
    odd = [f"column {at.column}: no ';' before '{at.text}'" for at in parser.unended]
    if any(token.text.startswith('"') for token in tokens):
        odd.append("write texts as '...'; the engine refuses double quotes since 4.9")
    return Script(source, statements, tuple(odd))


def parse_question(source: str) -> Script:
    """Parse a script that is asked for its value; an empty one has none."""
    script = parse_script(source)
    if not script.statements:
        raise ScriptError("the script is empty")
    return script


@lru_cache(maxsize=4096)
def parse_text(source: str) -> Script:
    """Return the names in a text with placeholders, `{variable}` or `{@board_key}`, as a script."""
    stray = re.search(r"[{}]", _PLACEHOLDER.sub("", source))
    if stray is not None:
        raise ScriptError(
            f"'{stray[0]}' belongs to no placeholder: write {{variable}} or {{@board_key}}"
        )
    return Script(source, tuple(map(Name, _PLACEHOLDER.findall(source))))


SCRIPTS: Final = frozenset({parse_script, parse_question, parse_text})
"""The checks of ports whose value is a script, or a text with names."""


def fill_text(source: str, environment: Environment) -> str:
    """Return a text with the values of its placeholders. Reals have up to three decimal places."""

    def value(match: re.Match[str]) -> str:
        try:
            value = environment.read(match[1])
        except (ScriptError, UnknownValueError):
            return UNKNOWN
        return f"{value:.3f}".rstrip("0").rstrip(".") if isinstance(value, float) else str(value)

    return _PLACEHOLDER.sub(value, source)


class _Token(NamedTuple):
    kind: str  # real, integer, text, name, operator or end
    text: str
    column: int  # in the script, from 1


def _tokens(source: str) -> list[_Token]:
    """Return the words of a script; the last one is of kind `end`."""
    if len(source) > _MAX_SCRIPT:
        raise ScriptError(f"the script is longer than {_MAX_SCRIPT} characters")
    tokens: list[_Token] = []
    at = 0
    while at < len(source):
        match = _TOKEN.match(source, at)
        if match is None:
            word = re.match(r"\w+|.", source[at:], re.DOTALL)
            hint = "; a script reads whole values, no members: let a leaf write the part it needs"
            got = f"'{word[0] if word else ''}'{hint if source[at] == '.' else ''}"
            raise ScriptError(f"column {at + 1}: unexpected {got}")
        if match.lastgroup != "space":
            tokens.append(_Token(str(match.lastgroup), match[0], at + 1))
        at = match.end()
    return [*tokens, _Token("end", "the end", len(source) + 1)]


class _Parser:
    def __init__(self, tokens: list[_Token]) -> None:
        self._tokens = tokens
        self._at = 0
        self._nesting = 0
        self._operators = 0
        self.unended: list[_Token] = []  # first words of statements that no ';' stands before

    @property
    def _next(self) -> _Token:
        return self._tokens[self._at]

    def _take(self, *signs: str) -> str:
        """Return the next word and go on, if it is one of the operators; else nothing."""
        token = self._next
        if token.kind != "operator" or token.text not in signs:
            return ""
        self._at += 1
        return token.text

    def _expect(self, sign: str) -> None:
        if not self._take(sign):
            raise self._fail(f"'{sign}'")

    def _fail(self, expected: str) -> ScriptError:
        token = self._next
        got = token.text if token.kind == "end" else f"'{token.text}'"
        return ScriptError(f"column {token.column}: expected {expected}, got {got}")

    def statements(self) -> Iterator[Expression]:
        """Parse everything; as in the engine, `;` may be left out or stand twice."""
        ended = True
        while self._next.kind != "end":
            if self._take(";"):
                ended = True
                continue
            if not ended:
                self.unended.append(self._next)
            ended = False
            yield self._assignment()

    def _nested(self, parse: Callable[[], Expression]) -> Expression:
        self._nesting += 1
        if self._nesting > _MAX_NESTING:
            raise ScriptError(f"column {self._next.column}: nested deeper than {_MAX_NESTING}")
        inner = parse()
        self._nesting -= 1
        return inner

    def _assignment(self) -> Expression:
        column = self._next.column
        left = self._conditional()
        sign = self._take(*_ASSIGNMENTS)
        if not sign:
            return left
        if not isinstance(left, Name):
            raise ScriptError(f"column {column}: only a variable can stand left of '{sign}'")
        return Assignment(left.name, sign, self._nested(self._assignment))

    def _conditional(self) -> Expression:
        condition = self._infix(0)
        if not self._take("?"):
            return condition
        then = self._nested(self._assignment)
        self._expect(":")
        return Op("?", (condition, then, self._nested(self._conditional)))

    def _infix(self, weakest: int) -> Expression:
        left = self._operand()
        while sign := self._take(*(one for one in _STRENGTH if _STRENGTH[one] >= weakest)):
            self._operators += 1
            if self._operators > _MAX_OPERATORS:
                raise ScriptError(f"more than {_MAX_OPERATORS} operators in one script")
            operands, links = [left, self._infix(_STRENGTH[sign] + 1)], [sign]
            while sign in COMPARISONS and (link := self._take(*COMPARISONS)):
                links.append(link)
                operands.append(self._infix(_STRENGTH[sign] + 1))
            left = Op(sign, tuple(operands), tuple(links) if sign in COMPARISONS else ())
        return left

    def _operand(self) -> Expression:
        token = self._next
        if sign := self._take("-", "!", "~"):
            return Op(f"{sign}x", (self._nested(self._operand),))
        if self._take("("):
            inner = self._nested(self._assignment)
            self._expect(")")
            return inner
        if token.kind in {"end", "operator"}:
            raise self._fail("a value")
        self._at += 1
        if token.text == "known" and self._take("("):
            name = self._next
            if name.kind != "name":
                raise self._fail("a variable or an @key")
            self._at += 1
            self._expect(")")
            return Known(name.text)
        return _atom(token)


def _atom(token: _Token) -> Expression:
    text = token.text
    if token.kind == "real":
        return Literal(float(text))
    if token.kind == "integer":
        return Literal(int(text, 16 if text[:2] in {"0x", "0X"} else 10))
    if token.kind == "text":
        return Literal(text[1:-1])
    return Literal(TRUTH_WORDS[text]) if text in TRUTH_WORDS else Name(text)
