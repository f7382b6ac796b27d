"""Drones on the ground and in the air; runs the tests that are coroutines."""

from __future__ import annotations

import asyncio
import gc
import inspect
from collections.abc import Coroutine
from typing import Any

import pytest

from tests.sim_bridge.loopback.loopback_client import PATIENCE_S
from tests.sim_bridge.loopback.loopback_world import Bench


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def flown(bench: Bench) -> Bench:
    bench.fly()
    return bench


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    if not inspect.iscoroutinefunction(pyfuncitem.obj):
        return None
    arguments = {name: pyfuncitem.funcargs[name] for name in pyfuncitem._fixtureinfo.argnames}
    asyncio.run(_watched(pyfuncitem.obj(**arguments)))
    return True


async def _watched(test: Coroutine[Any, Any, None]) -> None:
    """Run a test, with a timeout; no task may fail unseen."""
    faults: list[Any] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, fault: faults.append(fault))
    await asyncio.wait_for(test, PATIENCE_S)
    gc.collect()  # asyncio tells of a fault when its task is freed
    assert faults == []
