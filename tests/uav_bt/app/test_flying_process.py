"""The process while a mission is set up: garbage collection waits."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest

from uav_bt.app.flying_process import collections_postponed


@pytest.fixture(autouse=True)
def _collections() -> Iterator[None]:
    yield
    gc.enable()


def test_collections_go_on_after_the_block_also_when_it_fails() -> None:
    with collections_postponed():
        assert not gc.isenabled()
    assert gc.isenabled()
    with pytest.raises(ZeroDivisionError), collections_postponed():
        1 / 0  # noqa: B018
    assert gc.isenabled()


def test_a_program_that_has_switched_collections_off_keeps_them_off() -> None:
    gc.disable()
    with collections_postponed():
        pass
    assert not gc.isenabled()
