"""Ports: the typed attributes of a node, given in a tree file as a literal or as a reference.

`{key}` refers to a variable of the tree, `{@key}` to a key of the mission board.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, Final, Generic, Literal, TypeVar

from uav_bt.errors import InputError, did_you_mean

__all__ = ["RESERVED_ATTRIBUTES", "Port", "Reference", "parse_reference"]

T = TypeVar("T")

RESERVED_ATTRIBUTES: Final = frozenset({"ID", "name"})

_PORT_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_REFERENCE: Final = re.compile(r"\s*\{\s*(?P<board>@?)(?P<key>[A-Za-z_][A-Za-z0-9_.\-]*|=)\s*\}\s*")
# Only what the format's own engine reads: no underscores, no "inf", no hexadecimal.
_INTEGER: Final = re.compile(r"[+-]?[0-9]+")
_NUMBER: Final = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_TRUE: Final = frozenset({"true", "True", "TRUE", "1"})
_FALSE: Final = frozenset({"false", "False", "FALSE", "0"})
_TYPE_WORDS: Final[dict[type, str]] = {
    int: "an integer",
    float: "a number",
    bool: "true or false",
    str: "a text",
}


@dataclass(frozen=True)
class Reference:
    """A port's value that lives elsewhere."""

    key: str
    on_board: bool  # True: a key of the mission board; False: a variable of the tree

    def __str__(self) -> str:
        """Return the reference as a tree file has it."""
        return f"{{{'@' if self.on_board else ''}{self.key}}}"


def parse_reference(text: str, port_name: str) -> Reference | None:
    """Return the reference that an attribute's text is, or None when it is a literal.

    Raises:
        ValueError: the text has braces like a reference, but no key that could exist.
    """
    match = _REFERENCE.fullmatch(text)
    if match is not None:
        key = match["key"]
        return Reference(port_name if key == "=" else key, on_board=bool(match["board"]))
    stripped = text.strip()
    if stripped.startswith("{") and stripped.endswith("}"):
        raise ValueError(f"'{text}' is no reference: write {{key}} or {{@board_key}}")
    return None


class _Required:
    def __repr__(self) -> str:
        return "required"


@dataclass(frozen=True)
class Port(Generic[T]):
    """A typed attribute of a node."""

    REQUIRED: ClassVar[Any] = _Required()

    name: str
    type: type[T]
    # A value, a reference such as "{@helipad}" (in braces), or REQUIRED.
    default: T | str = REQUIRED
    doc: str = ""  # one line, with the unit
    direction: Literal["input", "output", "inout"] = "input"
    choices: tuple[T, ...] = ()  # all values there are; empty: any of the type
    # Returns normally or raises ValueError (or an InputError) saying what was expected.
    check: Callable[[T], object] | None = None

    def __post_init__(self) -> None:
        if not _PORT_NAME.fullmatch(self.name) or self.name in RESERVED_ATTRIBUTES:
            raise ValueError(f"'{self.name}' cannot be a port's name")

    @property
    def required(self) -> bool:
        """True when a tree file must give a value; an output that nobody wants goes nowhere."""
        return self.default is Port.REQUIRED and self.direction != "output"

    @property
    def takes_all(self) -> bool:
        """True when every value of the type will do."""
        return self.check is None and not self.choices

    def bind(self, given: object) -> T | Reference:
        """Turn what a tree file or a Python caller gives into a checked value or a reference.

        Raises:
            ValueError: it is neither; the message says what was expected.
        """
        if isinstance(given, str):
            reference = parse_reference(given, self.name)
            if reference is not None:
                return reference
        if self.direction != "input":
            raise ValueError(f"an {self.direction} port needs a reference like {{key}}")
        return self.convert(given)

    def convert(self, value: object) -> T:
        """Return a value as this port's type; texts are parsed.

        Raises:
            ValueError: the value does not fit; the message says what was expected.
        """
        typed: Any = self._parse(value) if isinstance(value, str) else self._cast(value)
        if self.choices and typed not in self.choices:
            known = [str(choice) for choice in self.choices]
            hint = did_you_mean(str(typed), known)
            raise ValueError(f"expected one of {', '.join(known)}; got '{typed}'{hint}")
        if self.check is not None:
            try:
                self.check(typed)
            except InputError as error:
                raise ValueError(str(error)) from error
        return typed  # type: ignore[no-any-return]  # of type T by the two parsers

    def read(self, value: object) -> T:
        """Return what a variable holds as this port's type.

        As the engine does, and unlike `convert`, this takes 0 and 1 (what scripts make of `false`
        and `true`) as truth values and writes numbers out as texts.

        Raises:
            ValueError: the value does not fit; the message says what was expected.
        """
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            if self.type is bool and value in {0, 1}:
                return self.convert(bool(value))
            if self.type is str:
                return self.convert(str(value) if isinstance(value, int) else f"{value:.6f}")
        return self.convert(value)

    def _parse(self, text: str) -> object:
        if self.type in {str, object}:
            return text
        stripped = text.strip()
        if self.type is bool and stripped in _TRUE | _FALSE:
            return stripped in _TRUE
        if self.type is int and _INTEGER.fullmatch(stripped):
            return int(stripped)
        if self.type is float and _NUMBER.fullmatch(stripped) and math.isfinite(float(stripped)):
            return float(stripped)
        raise ValueError(f"expected {self._type_words()}, got '{text}'")

    def _cast(self, value: object) -> object:
        if isinstance(value, bool) and self.type is not bool:
            raise ValueError(f"expected {self._type_words()}, got {value}")
        if self.type is float and isinstance(value, int):
            return float(value)
        if self.type is int and isinstance(value, float) and value.is_integer():
            return int(value)
        if not isinstance(value, self.type):
            got = f"{type(value).__name__} {value!r:.80}"
            raise ValueError(f"expected {self._type_words()}, got {got}")  # noqa: TRY004  # as documented
        return value

    def _type_words(self) -> str:
        return _TYPE_WORDS.get(self.type, f"a {self.type.__name__}")


def bind_ports(
    ports: Iterable[Port[Any]], given: dict[str, object], also: Iterable[str] = ()
) -> tuple[dict[str, Any], dict[str, str]]:
    """Bind all ports of a node at once.

    Args:
        ports: what the node declares.
        given: values by attribute name.
        also: other attributes that the node may have, for suggestions.

    Returns:
        The bound values (or references) by port, and what is wrong by attribute.
    """
    bound: dict[str, Any] = {}
    wrong: dict[str, str] = {}
    by_name = {port.name: port for port in ports}
    for name in given:
        if name not in by_name:
            known = [*by_name, *also]
            wrong[name] = f"unknown attribute '{name}'{did_you_mean(name, known)}"
    for name, port in by_name.items():
        if name not in given and port.default is Port.REQUIRED:
            if port.required:
                wrong[name] = f"attribute '{name}' is missing ({port.doc})"
            continue
        try:
            bound[name] = port.bind(given.get(name, port.default))
        except ValueError as error:
            wrong[name] = f"attribute '{name}': {error}"
    return bound, wrong
