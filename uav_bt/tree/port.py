"""Ports: the typed attributes of a node, given in a tree file as a literal or as a reference.

`{key}` refers to a variable of the tree, `{@key}` to a key of the mission board.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Final, Generic, Literal, NamedTuple, TypeVar

from uav_bt.errors import InputError, did_you_mean
from uav_bt.tree.script.parser import SCRIPTS, Script, parse_script, parse_text

T = TypeVar("T")

ASKED: Final = frozenset({"_failureIf", "_successIf", "_skipIf", "_while"})
"""The conditions of nodes whose value must be true or false."""

CONDITION_ATTRIBUTES: Final = ASKED | {"_onSuccess", "_onFailure", "_post", "_onHalted"}
"""The attributes of any node with scripts that run before and after its tick."""

MAX_INTEGER: Final = 2**63  # largest magnitude that the format's engine reads
_MAX_DIGITS: Final = 400  # more than any number needs; Python refuses to read 5,000
INTEGER: Final = r"-?[0-9]+"
REAL: Final = r"-?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+\-]?[0-9]+)?"
_PORT_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
REFERENCE_KEY: Final = r"[A-Za-z_][A-Za-z0-9_.\-]*|="
_REFERENCE: Final = re.compile(rf"\s*\{{\s*(?P<board>@?)(?P<key>{REFERENCE_KEY})\s*\}}\s*")


class PortType(NamedTuple):
    """How the values of a type are written."""

    words: str  # name in messages
    cpp_name: str  # name in graphical editors and other engines of the format
    # Of the literals, for Python and XML Schema; None: any text. Only literals that the format's
    # engine reads: no underscores, "inf", hexadecimal digits or plus sign; blanks only at the end.
    pattern: str | None = None


PORT_TYPES: Final[dict[type, PortType]] = {
    int: PortType("an integer", "int", rf"{INTEGER}\s*"),
    float: PortType("a number", "double", rf"{REAL}\s*"),
    bool: PortType("true or false", "bool", "true|True|TRUE|1|false|False|FALSE|0"),
    str: PortType("a text", "std::string"),
    object: PortType("a value", "BT::AnyTypeAllowed"),
}
"""The types that have literals; a port of any other type takes references only."""


@dataclass(frozen=True)
class Reference:
    """A reference to a port's value on the board or in a variable of the tree."""

    key: str
    on_board: bool  # True: a key of the mission board; False: a variable of the tree

    def __str__(self) -> str:
        """Return the reference as written in a tree file."""
        return f"{{{'@' if self.on_board else ''}{self.key}}}"


def parse_reference(text: str, port_name: str) -> Reference | None:
    """Return the reference that an attribute's text is, or None when it is a literal.

    `{=}` stands for the port's name. Braces around no valid key raise a ValueError.
    """
    match = _REFERENCE.fullmatch(text)
    if match is not None:
        key = match["key"]
        return Reference(port_name if key == "=" else key, on_board=bool(match["board"]))
    stripped = text.strip()
    if stripped.startswith("{") and stripped.endswith("}"):
        raise ValueError(f"'{text}' is not a reference: write {{key}} or {{@board_key}}")
    return None


@dataclass(frozen=True)
class Port(Generic[T]):
    """A typed attribute of a node, given in a tree file or as a keyword argument in Python."""

    REQUIRED: ClassVar[Any] = object()

    name: str
    # int, float, bool and str are written as literals; any other type takes references only.
    type: type[T]
    default: T | str = REQUIRED  # a value, a reference such as "{@mark}" in braces, or REQUIRED
    doc: str = ""  # in one line, with the unit
    direction: Literal["input", "output", "inout"] = "input"  # reads the value, writes it, or both
    choices: tuple[T, ...] = ()  # the allowed values; empty: any value of the type
    least: float | None = None  # bounds of a number, inclusive
    most: float | None = None
    # Raises a ValueError or InputError for an invalid value, which says what is expected.
    check: Callable[[T], object] | None = None
    # Raises likewise when the named file or network does not exist. `uav-bt check` calls it; dry
    # runs and benches, which load nothing, do not.
    look_up: Callable[[T], object] | None = None
    # Returns a warning of `uav-bt check` about a valid but unusual value, or None.
    caution: Callable[[T], str | None] | None = None
    sample: str = ""  # a value for examples of a required port with a check
    takes: tuple[Any, ...] | None = None  # for type `object`: the types that it can use; None: all
    at_setup: bool = False  # read in `on_setup`, so that its value is needed before the take-off
    places: bool = False  # a list of places, which may come from a file (`file:rounds.csv`)

    def __post_init__(self) -> None:
        if not _PORT_NAME.fullmatch(self.name) or self.name in {"ID", "name"}:
            raise ValueError(f"'{self.name}' cannot be a port's name")
        if self.range and self.type not in {int, float}:
            raise ValueError(f"port '{self.name}': only numbers have a range")

    @property
    def required(self) -> bool:
        """True when a tree file must give a value. Outputs may stay unconnected."""
        return self.default is Port.REQUIRED and self.direction != "output"

    @property
    def words(self) -> str:
        """Names of the types that it takes."""
        types: tuple[Any, ...] = self.takes or (self.type,)
        return " or ".join(one.__name__ for one in types)

    @property
    def takes_all(self) -> bool:
        """True when the port accepts every value of its type."""
        return self.check is None and not self.choices and not self.range

    @property
    def range(self) -> str:
        """Allowed range of a number, in words; empty without a range."""
        if self.least is None:
            return "" if self.most is None else f"{self.most:g} or less"
        return f"{self.least:g} " + ("or more" if self.most is None else f"to {self.most:g}")

    def script(self, value: object) -> Script | None:
        """Return the script that a value is, if it is one."""
        if self.check not in SCRIPTS or not isinstance(value, str):
            return None
        return parse_text(value) if self.check is parse_text else parse_script(value)

    @cached_property
    def bound_default(self) -> T | Reference:
        """The default as `bind` returns it, computed once because most nodes use it."""
        return self.bind(self.default)

    def bind(self, given: object) -> T | Reference:
        """Return a value of a tree file or of Python, checked, or a reference."""
        if isinstance(given, str) and self.check is not parse_text:  # it fills in its own names
            reference = parse_reference(given, self.name)
            if reference is not None:
                return reference
        if self.direction == "output":
            raise ValueError("an output port needs a reference like {key}")
        return self.convert(given)

    def convert(self, value: object) -> T:
        """Return a value as this port's type; a ValueError says which one it expects."""
        typed: Any = self._parse(value) if isinstance(value, str) else self._cast(value)
        if self.choices and typed not in self.choices:
            known = [str(choice) for choice in self.choices]
            hint = did_you_mean(str(typed), known)
            raise ValueError(f"expected one of {', '.join(known)}; got '{typed}'{hint}")
        least, most = (-math.inf if self.least is None else self.least), self.most
        if self.range and not least <= typed <= (math.inf if most is None else most):
            raise ValueError(f"expected {self.range}, got {typed}")
        if self.check is not None:
            try:
                self.check(typed)
            except InputError as error:
                raise ValueError(str(error)) from error
        return typed  # type: ignore[no-any-return]  # of type T by the two parsers

    def read(self, value: object) -> T:
        """Return a variable's value as this port's type.

        As the engine does, and unlike `convert`, this takes 0 and 1 (what scripts make of `false`
        and `true`) as truth values and writes numbers out as texts.
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
        known = PORT_TYPES.get(self.type)
        pattern = known.pattern if known is not None and known.pattern else "(?!)"
        if len(text) <= _MAX_DIGITS and re.fullmatch(pattern, text):
            if self.type is bool:
                return text.lower() in {"true", "1"}
            value: Any = self.type(text)  # type: ignore[call-arg]  # int or float
            if abs(value) < (MAX_INTEGER if self.type is int else math.inf):
                return value
        bare = text.strip().removeprefix("+")
        cure = bare != text and re.fullmatch(pattern, bare) is not None
        hint = f": write '{bare}', without blanks or a plus before it" if cure else ""
        raise ValueError(f"expected {self._type_words()}, got '{text}'{hint}")

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
        known = PORT_TYPES.get(self.type)
        return f"a {self.type.__name__}" if known is None else known.words


def port_text(value: object) -> str:
    """Return a port's value as a tree file has it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def bind_ports(
    ports: Iterable[Port[Any]], given: Mapping[str, object]
) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the bound values or references by port, and the errors by attribute."""
    bound: dict[str, Any] = {}
    by_name = {port.name: port for port in ports}
    known = [*by_name, *CONDITION_ATTRIBUTES]
    wrong = {
        name: f"unknown attribute '{name}'{did_you_mean(name, known)}"
        for name in given
        if name not in by_name
    }
    for name, port in by_name.items():
        try:
            if name in given:
                bound[name] = port.bind(given[name])
            elif port.default is not Port.REQUIRED:
                bound[name] = port.bound_default
            elif port.required:
                wrong[name] = f"attribute '{name}' is missing ({port.doc})"
        except ValueError as error:
            wrong[name] = f"attribute '{name}': {error}"
    return bound, wrong


def check_declared(owner: type, name: str, kind: type) -> None:
    """Refuse a class attribute that is no tuple of objects of one kind, as `(HEIGHT)` is none."""
    declared = getattr(owner, name)
    if not isinstance(declared, (tuple, list)) or not all(isinstance(e, kind) for e in declared):
        raise TypeError(
            f"{owner.__qualname__}.{name} must be a tuple of {kind.__name__} objects, such as "
            f"`{name} = (FIRST, SECOND)` or `{name} = (ONLY,)`; got {declared!r:.80}"
        )
