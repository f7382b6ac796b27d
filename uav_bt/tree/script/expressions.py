"""What scripts are made of, and what each part evaluates to."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

from uav_bt.errors import UnknownValueError
from uav_bt.tree.script.values import (
    MAX_TEXT,
    Environment,
    ScriptError,
    Value,
    compare_equal,
    truth,
)
from uav_bt.tree.variables import Variables


@dataclass(frozen=True)
class Literal:
    """A number or a text."""

    value: Value
    parts = ()

    def evaluate(self, _: Environment) -> Value:
        """Return the value."""
        return self.value


@dataclass(frozen=True)
class Name:
    """A variable, an enumeration's member, or with `@` a key of the mission board."""

    name: str
    parts = ()

    def evaluate(self, environment: Environment) -> Value:
        """Return the value of the name."""
        return environment.read(self.name)


@dataclass(frozen=True)
class Known:
    """`known(x)` or `known(@key)`: 1 when the variable has a value or the key a fresh one."""

    name: str
    parts = ()

    def evaluate(self, environment: Environment) -> Value:
        """Return 1 or 0."""
        return float(environment.known(self.name))


@dataclass(frozen=True)
class Assignment:
    """`:=` makes or changes a variable; `=`, `+=` and the like change one that exists."""

    name: str
    sign: str
    value: Expression

    @property
    def parts(self) -> tuple[Expression, ...]:
        """The right side."""
        return (self.value,)

    def evaluate(self, environment: Environment) -> Value:
        """Write the variable and return its value."""
        if self.sign != ":=" and not environment.holds(self.name):
            raise ScriptError(f"there is no variable '{self.name}'; make a new one with ':='")
        value = self.value.evaluate(environment)
        if self.sign not in {":=", "="}:
            value = _computed(self.sign[0], environment.read(self.name), value)
        kept: Value = environment.write(self.name, value)
        return kept


@dataclass(frozen=True)
class Op:
    """An operator and its operands.

    A chain of comparisons such as `1 < x <= 3` is one: its sign is the first, `links` has all.
    """

    sign: str
    parts: tuple[Expression, ...]
    links: tuple[str, ...] = ()

    def evaluate(self, environment: Environment) -> Value:
        """Apply the operator to its operands."""
        return _OPERATIONS[self.sign](self, environment)


Expression = Literal | Name | Known | Assignment | Op


def walk(expression: Expression) -> Iterator[Expression]:
    """Iterate over an expression and all its parts."""
    yield expression
    for part in expression.parts:
        yield from walk(part)


def _integer(value: float) -> int:
    if not float(value).is_integer():
        raise ScriptError(f"expected an integer, got {value}")
    return int(value)


def _divided(left: float, right: float) -> float:
    if right == 0.0:
        raise ScriptError("division by zero")
    return left / right


_UNARY: Final[dict[str, Callable[[float], float]]] = {
    "-x": operator.neg,
    "!x": lambda value: float(not value),
    "~x": lambda value: float(~_integer(value)),
}
_ARITHMETIC: Final[dict[str, Callable[[float, float], float]]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": _divided,
    "&": lambda left, right: float(_integer(left) & _integer(right)),
    "|": lambda left, right: float(_integer(left) | _integer(right)),
    "^": lambda left, right: float(_integer(left) ^ _integer(right)),
}
_DECIDING: Final = {"&&": False, "||": True}  # the operand that decides alone
COMPARISONS: Final[dict[str, Callable[[Any, Any], bool]]] = {
    "==": compare_equal,
    "!=": lambda left, right: not compare_equal(left, right),
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_OF_TEXTS: Final = {**COMPARISONS, "==": operator.eq, "!=": operator.ne}


def _unary(op: Op, environment: Environment) -> Value:
    value = op.parts[0].evaluate(environment)
    if isinstance(value, str) and op.sign != "!x":
        raise ScriptError(f"'{op.sign[0]}' cannot be applied to a text")
    return _UNARY[op.sign](truth(value) if isinstance(value, str) else float(value))


def _computed(sign: str, left: Value, right: Value) -> Value:
    texts = isinstance(left, str) + isinstance(right, str)
    if (sign == ".." and texts) or (sign == "+" and texts == 2):
        joined = f"{left}{right}"
        if len(joined) > MAX_TEXT:
            raise ScriptError(f"a text grows longer than {MAX_TEXT} characters")
        return joined
    if texts or sign == "..":
        kinds = "a text and a number" if texts == 1 else "texts" if texts else "numbers"
        raise ScriptError(f"'{sign}' cannot be applied to {kinds}")
    return _ARITHMETIC[sign](float(left), float(right))


def _binary(op: Op, environment: Environment) -> Value:
    left, right = op.parts
    return _computed(op.sign, left.evaluate(environment), right.evaluate(environment))


def _decided(op: Op, environment: Environment) -> Value:
    """Evaluate both sides, as the engine does; an unknown board key counts where it decides."""
    deciding = _DECIDING[op.sign]
    found: list[bool] = []
    unknown: UnknownValueError | None = None
    for operand in op.parts:
        try:
            found.append(truth(operand.evaluate(environment)))
        except UnknownValueError as error:
            unknown = unknown or error
    if unknown is not None and deciding not in found:
        raise unknown
    return float(deciding in found if deciding else deciding not in found)


def _compared(op: Op, environment: Environment) -> Value:
    """Compare link by link; what follows a false one is not evaluated."""
    left = op.parts[0].evaluate(environment)
    for sign, operand in zip(op.links, op.parts[1:], strict=True):
        right = operand.evaluate(environment)
        if isinstance(left, str) and isinstance(right, str):
            holds = _OF_TEXTS[sign](left, right)
        else:
            holds = COMPARISONS[sign](environment.number(left), environment.number(right))
        if not holds:
            return 0.0
        left = right
    return 1.0


def _conditional(op: Op, environment: Environment) -> Value:
    condition, then, otherwise = op.parts
    value = condition.evaluate(environment)
    chosen = value != "" and truth(value) if isinstance(value, str) else value != 0
    return (then if chosen else otherwise).evaluate(environment)


_OPERATIONS: Final[dict[str, Callable[[Op, Environment], Value]]] = {
    **dict.fromkeys(_UNARY, _unary),
    **dict.fromkeys((*_ARITHMETIC, ".."), _binary),
    **dict.fromkeys(_DECIDING, _decided),
    **dict.fromkeys(COMPARISONS, _compared),
    "?": _conditional,
}


# --- what is certain before a script runs ---------------------------------------------------------


def kind_of(expression: Expression) -> type | None:
    """Return the type of an expression's value, or None when it is known only at run time."""
    if isinstance(expression, Literal):
        return type(expression.value)
    if not isinstance(expression, Op):  # else a name, or an assignment, which keeps its type
        return float if isinstance(expression, Known) else None
    if expression.sign not in {"+", "?"}:
        return str if expression.sign == ".." else float
    kinds = {kind_of(part) for part in expression.parts[-2:]}
    if expression.sign == "+" and None not in kinds:
        return str if kinds == {str} else float
    return kinds.pop() if len(kinds) == 1 else None


def certain_parts(expression: Expression) -> Iterator[Expression]:
    """Iterate over the parts that are evaluated whenever the expression is, itself first."""
    yield expression
    parts = expression.parts
    if isinstance(expression, Op) and expression.sign == "?":
        parts = parts[:1]
    elif isinstance(expression, Op) and expression.links:
        parts = parts[:2]  # a false link ends the chain
    for part in parts:
        yield from certain_parts(part)


def is_constant(expression: Expression) -> bool:
    """Return whether an expression reads and writes no variable."""
    return not any(isinstance(part, (Name, Known, Assignment)) for part in walk(expression))


def constant_value(expression: Expression) -> Value | None:
    """Return the value of an expression that reads no variable; None for another one."""
    if not is_constant(expression):
        return None
    try:
        return expression.evaluate(Environment(Variables()))
    except (ScriptError, OverflowError):
        return None
