"""Ports: conversion of literals and references."""

from __future__ import annotations

from typing import Any

import pytest

from uav_bt.errors import ValueRangeError
from uav_bt.tree.port import Port, Reference, bind_ports, parse_reference


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        (int, "3", 3),
        (int, "-3 ", -3),
        (float, "1.5", 1.5),
        (float, "2", 2.0),
        (float, "1e-3", 1e-3),
        (float, ".5", 0.5),
        (bool, "true", True),
        (bool, "False", False),
        (bool, "0", False),
        (str, " as it is ", " as it is "),
    ],
)
def test_literals_are_typed(kind: type, text: str, value: object) -> None:
    """A text becomes a value of the port's type."""
    bound = Port("p", kind).bind(text)
    assert bound == value
    assert type(bound) is kind


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        (int, "3.0"),
        (int, "0x10"),
        (int, "1_000"),
        (int, ""),
        (float, "nan"),
        (float, "inf"),
        (float, "1e999"),
        (float, "1,5"),
        (float, "1_0"),
        (bool, "yes"),
        (bool, "2"),
        (list, "[1]"),
    ],
)
def test_mistyped_literals_are_refused(kind: type, text: str) -> None:
    """Only texts of the format are accepted; the message has the expected form."""
    with pytest.raises(ValueError, match="expected"):
        Port("p", kind).bind(text)


@pytest.mark.parametrize(
    ("kind", "value"), [(int, True), (float, "x"), (int, 1.5), (bool, 1), (str, 3)]
)
def test_mistyped_python_values_are_refused(kind: type, value: object) -> None:
    """A value from Python is checked like a text."""
    with pytest.raises(ValueError, match="expected"):
        Port("p", kind).bind(value)


def test_python_numbers_widen() -> None:
    """An integer is accepted as a float, and a float with an integral value as an integer."""
    assert Port("p", float).bind(2) == 2.0
    assert type(Port("p", float).bind(2)) is float
    assert Port("p", int).bind(2.0) == 2


@pytest.mark.parametrize(
    ("text", "reference"),
    [
        ("{speed}", Reference("speed", on_board=False)),
        ("{@mark}", Reference("mark", on_board=True)),
        (" { speed } ", Reference("speed", on_board=False)),
        ("{=}", Reference("p", on_board=False)),
        ("plain", None),
        ("a {b} c", None),
    ],
)
def test_references(text: str, reference: Reference | None) -> None:
    """Braces around a key make a reference, `{=}` one to the port's own name."""
    assert parse_reference(text, "p") == reference


@pytest.mark.parametrize("text", ["{}", "{a b}", "{@}", "{1x}"])
def test_broken_references_are_refused(text: str) -> None:
    """An invalid reference does not become a literal."""
    with pytest.raises(ValueError, match="not a reference"):
        parse_reference(text, "p")


def test_choices_come_with_a_suggestion() -> None:
    """A value outside the choices is refused, and the nearest choice is named."""
    port = Port("side", str, choices=("left", "right"))
    assert port.bind("left") == "left"
    with pytest.raises(ValueError, match="left, right; got 'lefft'; did you mean 'left'"):
        port.bind("lefft")


def test_checks_speak_for_themselves() -> None:
    """The message of a port's check is kept, also that of our errors."""

    def positive(value: float) -> None:
        if value <= 0:
            raise ValueRangeError("must be above 0")

    with pytest.raises(ValueError, match="must be above 0"):
        Port("p", float, check=positive).bind("-1")


@pytest.mark.parametrize(
    ("least", "most", "words", "wrong"),
    [(0.3, 20, "0.3 to 20", "0.29"), (0, None, "0 or more", "-1"), (None, 9, "9 or less", "9.5")],
)
def test_numbers_keep_to_their_range(
    least: float | None, most: float | None, words: str, wrong: str
) -> None:
    """Bounds apply to literals and variables; they are inclusive."""
    port = Port("p", float, least=least, most=most)
    assert port.range == words
    assert not port.takes_all
    for bound in (least, most):
        assert bound is None or port.bind(f"{bound}") == bound
    with pytest.raises(ValueError, match=f"expected {words}, got {wrong}"):
        port.bind(wrong)
    with pytest.raises(ValueError, match=f"expected {words}, got {wrong}"):
        port.read(float(wrong))


def test_only_numbers_have_a_range() -> None:
    with pytest.raises(ValueError, match="only numbers have a range"):
        Port("p", str, most=3)


@pytest.mark.parametrize("text", ["9" * 19, "-" + "9" * 400, "9" * 5000])
def test_integers_have_64_bits(text: str) -> None:
    """Otherwise the arithmetic of a Timeout of 10**400 ms would end a mission."""
    with pytest.raises(ValueError, match="integer"):
        Port("p", int).bind(text)


def test_output_ports_need_a_reference() -> None:
    """An output port needs a reference."""
    port = Port("out", int, direction="output")
    assert port.bind("{x}") == Reference("x", on_board=False)
    with pytest.raises(ValueError, match="needs a reference"):
        port.bind("3")


@pytest.mark.parametrize("name", ["name", "ID", "_x", "", "a b", "1a"])
def test_reserved_port_names(name: str) -> None:
    """A port cannot have a reserved name of the format."""
    with pytest.raises(ValueError, match="cannot be a port's name"):
        Port(name, int)


def test_bind_ports_reports_everything() -> None:
    """Missing, unknown and mistyped attributes are all reported, by attribute."""
    ports: list[Port[Any]] = [
        Port("height_m", float, doc="height, m"),
        Port("count", int, default=2),
        Port("fast", bool, default=False),
    ]
    bound, wrong = bind_ports(ports, {"heigth_m": "1", "fast": "maybe"})
    assert bound == {"count": 2}
    assert wrong == {
        "heigth_m": "unknown attribute 'heigth_m'; did you mean 'height_m'?",
        "height_m": "attribute 'height_m' is missing (height, m)",
        "fast": "attribute 'fast': expected true or false, got 'maybe'",
    }
