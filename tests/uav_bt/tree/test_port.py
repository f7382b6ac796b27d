"""Ports: conversion of literals and references."""

from __future__ import annotations

import pytest

from tests.worlds.tables import cases
from uav_bt.errors import ValueRangeError
from uav_bt.tree.port import Port, Reference, parse_reference

CASES = cases("ports")
KINDS: dict[str, type] = {kind.__name__: kind for kind in (int, float, bool, str, list)}


@pytest.mark.parametrize(("kind", "given", "value"), CASES["typed"])
def test_values_are_typed(kind: str, given: object, value: object) -> None:
    bound = Port("p", KINDS[kind]).bind(given)
    assert bound == value
    assert type(bound) is KINDS[kind]


@pytest.mark.parametrize(
    ("kind", "given", "expected"), [*CASES["refused"], ("int", "9" * 5000, "an integer")]
)
def test_mistyped_values_are_refused(kind: str, given: object, expected: str) -> None:
    with pytest.raises(ValueError, match=f"expected {expected}"):
        Port("p", KINDS[kind]).bind(given)


@pytest.mark.parametrize(("kind", "value", "read"), CASES["read"])
def test_variables_are_read_as_the_engine_reads_them(
    kind: str, value: object, read: object
) -> None:
    """A script's `true` is valid for a port of booleans, its number for a port of texts."""
    port = Port("p", KINDS[kind])
    if read is None:
        with pytest.raises(ValueError, match="expected"):
            port.read(value)
    else:
        assert port.read(value) == read


@pytest.mark.parametrize(("text", "name", "on_board"), CASES["references"])
def test_references(text: str, name: str | None, *, on_board: bool) -> None:
    """Braces around a key make a reference, `{=}` one to the port's own name."""
    if name == "":
        with pytest.raises(ValueError, match="not a reference"):
            parse_reference(text, "p")
    else:
        wanted = None if name is None else Reference(name, on_board=on_board)
        assert parse_reference(text, "p") == wanted


@pytest.mark.parametrize(
    ("least", "most", "words", "wrong"),
    [(0.3, 20, "0.3 to 20", "0.29"), (0, None, "0 or more", "-1"), (None, 9, "9 or less", "9.5")],
)
def test_numbers_keep_to_their_range(
    least: float | None, most: float | None, words: str, wrong: str
) -> None:
    port = Port("p", float, least=least, most=most)
    assert port.range == words
    assert not port.takes_all
    for bound in (least, most):
        assert bound is None or port.bind(f"{bound}") == bound
    for take in (port.bind, lambda text: port.read(float(text))):
        with pytest.raises(ValueError, match=f"expected {words}, got {wrong}"):
            take(wrong)


def test_other_refusals() -> None:
    with pytest.raises(ValueError, match="only numbers have a range"):
        Port("p", str, most=3)
    port = Port("out", int, direction="output")
    assert port.bind("{x}") == Reference("x", on_board=False)
    with pytest.raises(ValueError, match="needs a reference"):
        port.bind("3")

    def positive(value: float) -> None:
        if value <= 0:
            raise ValueRangeError("must be above 0")

    with pytest.raises(ValueError, match="must be above 0"):
        Port("p", float, check=positive).bind("-1")


@pytest.mark.parametrize("name", ["name", "ID", "_x", "", "a b", "1a"])
def test_reserved_port_names(name: str) -> None:
    with pytest.raises(ValueError, match="cannot be a port's name"):
        Port(name, int)
