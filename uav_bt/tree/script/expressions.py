"""What scripts are made of, what each part comes to, and what of that is certain beforehand."""

from __future__ import annotations

import operator
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

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


class Expression(ABC):
    """A part of a script."""

    @abstractmethod
    def evaluate(self, environment: Environment) -> Value:
        """Return the value of the expression.

        Raises:
            ScriptError: it comes to nothing.
        """

    def parts(self) -> tuple[Expression, ...]:
        """Return the parts it is made of."""
        return ()

    def walk(self) -> Iterator[Expression]:
        """Iterate over this and all its parts."""
        yield self
        for part in self.parts():
            yield from part.walk()


@dataclass(frozen=True)
class Literal(Expression):
    """A number or a text."""

    value: Value

    def evaluate(self, environment: Environment) -> Value:
        """Return it."""
        del environment
        return self.value


@dataclass(frozen=True)
class Name(Expression):
    """A variable, an enumeration's member, or with `@` a key of the mission board."""

    name: str

    def evaluate(self, environment: Environment) -> Value:
        """Return the value of the name."""
        return environment.read(self.name)


@dataclass(frozen=True)
class Known(Expression):
    """`known(x)` or `known(@key)`: 1 when the variable has a value or the key a fresh one."""

    name: str

    def evaluate(self, environment: Environment) -> Value:
        """Return 1 or 0."""
        return float(environment.known(self.name))


_UNARY: Final[dict[str, Callable[[float], float]]] = {
    "-": operator.neg,
    "!": lambda value: float(not value),
    "~": lambda value: float(~_integer(value)),
}


@dataclass(frozen=True)
class Unary(Expression):
    """`-x`, `!x` or `~x`."""

    sign: str
    operand: Expression

    def parts(self) -> tuple[Expression, ...]:
        """Return the operand."""
        return (self.operand,)

    def evaluate(self, environment: Environment) -> Value:
        """Apply the sign; of texts, `!` takes those that spell a truth value."""
        value = self.operand.evaluate(environment)
        if isinstance(value, str) and self.sign == "!":
            return float(not truth(value))
        if isinstance(value, str):
            raise ScriptError(f"'{self.sign}' cannot be applied to a text")
        return _UNARY[self.sign](float(value))


def _divided(left: float, right: float) -> float:
    if right == 0.0:
        raise ScriptError("division by zero")
    return left / right


def _integer(value: float) -> int:
    if not float(value).is_integer():
        raise ScriptError(f"expected an integer, got {value}")
    return int(value)


_BINARY: Final[dict[str, Callable[[float, float], float]]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": _divided,
    "&": lambda left, right: float(_integer(left) & _integer(right)),
    "|": lambda left, right: float(_integer(left) | _integer(right)),
    "^": lambda left, right: float(_integer(left) ^ _integer(right)),
}
_DECIDING: Final = {"&&": False, "||": True}  # the operand that decides alone


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
    return _BINARY[sign](float(left), float(right))


@dataclass(frozen=True)
class Binary(Expression):
    """Two operands and what joins them."""

    sign: str
    left: Expression
    right: Expression

    def parts(self) -> tuple[Expression, ...]:
        """Return both operands."""
        return self.left, self.right

    def evaluate(self, environment: Environment) -> Value:
        """Evaluate both, then join them."""
        if self.sign in _DECIDING:
            return self._decided(environment)
        left = self.left.evaluate(environment)
        return _computed(self.sign, left, self.right.evaluate(environment))

    def _decided(self, environment: Environment) -> float:
        """Evaluate both sides, as the engine does; an unknown board key counts where it decides."""
        deciding = _DECIDING[self.sign]
        found: list[bool] = []
        unknown: UnknownValueError | None = None
        for operand in self.parts():
            try:
                found.append(truth(operand.evaluate(environment)))
            except UnknownValueError as error:
                unknown = unknown or error
        if unknown is not None and deciding not in found:
            raise unknown
        return float(deciding in found if deciding else deciding not in found)


_COMPARISONS: Final[dict[str, Callable[[float, float], bool]]] = {
    "==": compare_equal,
    "!=": lambda left, right: not compare_equal(left, right),
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_TEXT_COMPARISONS: Final[dict[str, Callable[[str, str], bool]]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


@dataclass(frozen=True)
class Comparison(Expression):
    """A chain such as `1 < x <= 3`: 1 when all of it holds, else 0."""

    first: Expression
    rest: tuple[tuple[str, Expression], ...]

    def parts(self) -> tuple[Expression, ...]:
        """Return all operands."""
        return (self.first, *(operand for _, operand in self.rest))

    def evaluate(self, environment: Environment) -> Value:
        """Compare link by link; what follows a false one is not evaluated."""
        left = self.first.evaluate(environment)
        for sign, operand in self.rest:
            right = operand.evaluate(environment)
            if isinstance(left, str) and isinstance(right, str):
                holds = _TEXT_COMPARISONS[sign](left, right)
            else:
                reals = environment.number(left), environment.number(right)
                holds = _COMPARISONS[sign](*reals)
            if not holds:
                return 0.0
            left = right
        return 1.0


@dataclass(frozen=True)
class Conditional(Expression):
    """`condition ? then : otherwise`."""

    condition: Expression
    then: Expression
    otherwise: Expression

    def parts(self) -> tuple[Expression, ...]:
        """Return all three."""
        return self.condition, self.then, self.otherwise

    def evaluate(self, environment: Environment) -> Value:
        """Evaluate the condition and one of the two."""
        value = self.condition.evaluate(environment)
        chosen = value != "" and truth(value) if isinstance(value, str) else value != 0
        return (self.then if chosen else self.otherwise).evaluate(environment)


@dataclass(frozen=True)
class Assignment(Expression):
    """`:=` makes or changes a variable, `=` and `+=` and the like change one that exists."""

    name: str
    sign: str
    value: Expression

    def parts(self) -> tuple[Expression, ...]:
        """Return the right side."""
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


def kind_of(expression: Expression) -> type | None:
    """Return the type of an expression's value, or None when it is known only at run time."""
    if isinstance(expression, Literal):
        return type(expression.value)
    if isinstance(expression, (Unary, Comparison, Known)):
        return float
    if isinstance(expression, Binary):
        return _joined(expression)
    if isinstance(expression, Conditional):
        then, otherwise = kind_of(expression.then), kind_of(expression.otherwise)
        return then if then is otherwise else None
    return None  # a name, or an assignment, which keeps the type of its variable


def _joined(binary: Binary) -> type | None:
    if binary.sign == "..":
        return str
    if binary.sign != "+":
        return float
    kinds = {kind_of(binary.left), kind_of(binary.right)}
    if None in kinds:
        return None
    return str if kinds == {str} else float


def certain_parts(expression: Expression) -> Iterator[Expression]:
    """Iterate over the parts that are evaluated whenever the expression is, itself first."""
    yield expression
    parts = expression.parts()
    if isinstance(expression, Conditional):
        parts = (expression.condition,)
    elif isinstance(expression, Comparison):
        parts = (expression.first, expression.rest[0][1])  # a false link ends the chain
    for part in parts:
        yield from certain_parts(part)


def constant_value(expression: Expression) -> Value | None:
    """Return the value of an expression that reads no variable; None for another one."""
    if not is_constant(expression):
        return None
    try:
        return expression.evaluate(Environment(Variables()))
    except (ScriptError, OverflowError):
        return None


def is_constant(expression: Expression) -> bool:
    """Return whether an expression reads and writes no variable."""
    return not any(isinstance(part, (Name, Known, Assignment)) for part in expression.walk())
