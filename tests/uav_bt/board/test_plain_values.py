"""Board values as plain data: all types are supported, the size is bounded."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uav_bt.board.plain_values import plain


class Colour(enum.Enum):
    RED = 1


@dataclass(frozen=True)
class Pair:
    left: Any
    right: Any


@pytest.mark.parametrize(
    ("value", "told"),
    [
        (None, None),
        (3, 3),
        (2**70, "71-bit integer"),
        (Colour.RED, "RED"),
        (np.float32(0.5), 0.5),
        (np.bool_(True), True),
        (np.zeros((4, 5, 3), np.uint8), "uint8 array 4x5x3"),
        (b"abc", "3 bytes"),
        ((1, [2]), [1, [2]]),
        ({"a": Pair(1, Colour.RED)}, {"a": {"left": 1, "right": "RED"}}),
        ({1: 2}, {"1": 2}),
        ({3}, [3]),
        (object(), "object"),
        (Pair, "type"),
        ("x" * 600, "x" * 500 + "..."),
        (list(range(100)), [*range(64), "..."]),
        ("\ud800", "?"),
    ],
)
def test_a_value_becomes_plain(value: object, told: object) -> None:
    assert plain(value) == told
    assert type(plain(value)) is type(told)


def test_long_and_deep_values_are_cut() -> None:
    told = plain({str(key): key for key in range(100)})
    assert (len(told), told["..."]) == (65, "100 in all")
    loop: list[Any] = []
    loop.append(loop)
    assert plain(loop) == [[[[[[["..."]]]]]]]


@settings(max_examples=50)
@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.binary(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text() | st.integers(), inner),
    )
)
def test_everything_can_be_sent(value: object) -> None:
    assert isinstance(msgpack.packb(plain(value)), bytes)
