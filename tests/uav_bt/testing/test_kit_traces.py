"""The kit against BehaviorTree.CPP: mocks and logs agree with the recorded traces."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from uav_bt.testing import NodeEvent, TreeBench, parse_tree
from uav_bt.tree import Leaf, NodeRegistry, Port
from uav_bt.tree import parse_tree as parse_mission
from uav_bt.tree.scripted import ScriptedLeaf

SAMPLE = Path(__file__).parents[2] / "data" / "bt_traces_sample.jsonl"
WORDS = {NodeEvent.STARTED: "start", NodeEvent.RAN: "running", NodeEvent.HALTED: "halt"}


class Scripted(Leaf):
    """The leaf of the traces' files; a mock replaces it."""

    ports = (Port("script", str, doc="what it answers"),)


REGISTRY = NodeRegistry([Scripted])


def mocked(trace: dict[str, Any]) -> TreeBench:
    leaves = [leaf for leaf in parse_mission(trace["xml"], REGISTRY).leaves() if _scripted(leaf)]
    mocks = {leaf.path: leaf.port_value("script") for leaf in leaves}
    bench = parse_tree(trace["xml"], REGISTRY, mocks=mocks)
    for key, value in trace["blackboard"].items():
        bench.variables[key] = value
    return bench


def _scripted(leaf: Leaf) -> bool:
    return isinstance(leaf, Scripted)


def leaf_events(bench: TreeBench, since: int) -> list[list[str]]:
    scripted = {
        leaf.path: leaf.name for leaf in bench.tree.leaves() if isinstance(leaf, ScriptedLeaf)
    }
    return [
        [WORDS[event.kind], scripted[event.path]]
        for event in bench.log.events[since:]
        if event.path in scripted and event.kind in WORDS
    ]


def mismatch(trace: dict[str, Any]) -> str | None:
    bench = mocked(trace)
    for index, expected in enumerate(trace["ticks"]):
        for key, value in trace["set"].get(str(index), {}).items():
            bench.variables[key] = value
        since = len(bench.log.events)
        if index in trace["halt"]:
            bench.halt()
        status = bench.tick()
        root = status.name
        told = leaf_events(bench, since)
        if (root, told) != (expected["root"], expected["events"]):
            return f"{trace['id']}, tick {index}: {root} {told}, not {expected}"
    return None


def test_mocks_and_log_agree_with_the_engine() -> None:
    """Root status and order of leaf events agree in each tick of every trace of the sample."""
    traces = [json.loads(line) for line in SAMPLE.read_text(encoding="utf-8").splitlines()]
    assert len(traces) >= 200
    assert [found for trace in traces if (found := mismatch(trace))] == []
