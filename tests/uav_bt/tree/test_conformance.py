"""Our engine reproduces recorded traces of BehaviorTree.CPP tick by tick."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from tests.conformance import mismatch, read_traces

TRACES = list(read_traces())


@pytest.mark.parametrize("trace", TRACES, ids=[trace["id"] for trace in TRACES])
def test_trace_agrees(trace: dict[str, Any]) -> None:
    """Root status, order of leaf events and variables equal the engine's in every tick."""
    assert mismatch(trace) is None


@pytest.mark.parametrize("part", ["root", "events", "blackboard"])
def test_a_false_trace_is_noticed(part: str) -> None:
    trace = copy.deepcopy(TRACES[0])
    wrong: dict[str, Any] = {"root": "SKIPPED", "events": [["halt", "x"]], "blackboard": {"a": -7}}
    trace["ticks"][3][part] = wrong[part]
    reason = mismatch(trace)
    assert reason is not None
    assert reason.startswith("tick 3")
