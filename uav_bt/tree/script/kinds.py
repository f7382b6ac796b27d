"""What a script's expressions come to, as far as that is certain before it runs."""

from __future__ import annotations

from collections.abc import Iterator

from uav_bt.tree.script.expressions import (
    Assignment,
    Binary,
    Comparison,
    Conditional,
    Expression,
    Literal,
    Name,
    Unary,
)


def kind_of(expression: Expression) -> type | None:
    """Return the type of an expression's value, or None when it is known only at run time."""
    if isinstance(expression, Literal):
        return type(expression.value)
    if isinstance(expression, (Unary, Comparison)):
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


def certain_names(expression: Expression) -> Iterator[Name]:
    """Iterate over the names that are read whenever the expression is evaluated."""
    if isinstance(expression, Name):
        yield expression
    elif isinstance(expression, Conditional):
        yield from certain_names(expression.condition)
    elif isinstance(expression, Comparison):
        yield from certain_names(expression.first)
        yield from certain_names(expression.rest[0][1])  # a false link ends the chain
    elif isinstance(expression, Assignment):
        yield from certain_names(expression.value)
    else:
        for part in expression.parts():
            yield from certain_names(part)
