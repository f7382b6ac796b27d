"""What is certain about a script before it runs."""

from __future__ import annotations

from collections.abc import Iterator

from uav_bt.tree.script.expressions import (
    Assignment,
    Expression,
    Known,
    Literal,
    Name,
    Op,
    walk,
)
from uav_bt.tree.script.values import Environment, ScriptError, Value
from uav_bt.tree.variables import Variables


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
