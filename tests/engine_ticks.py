"""Recorder of BehaviorTree.CPP's ticks on the trees of `tests/data/tree_projects`.

This project does not depend on the engine. The package `behaviortreepy` 0.1.4 contains its release
4.8.2; install it into this project's environment for the recording:

    pip install --no-deps behaviortreepy==0.1.4
    python -m tests.engine_ticks

The second command writes `engine_ticks.yaml` there. Nodes that the engine does not know are
replaced. A palette's leaves answer by the run's script and have no ports; after a success a script
writes their outputs. A palette's control nodes become the nodes that the script names for them.
"""

from __future__ import annotations

import importlib
import re
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree as ET  # for writing only; the project's reader reads the files

import yaml

from tests.tree_projects import PROJECTS, Run, read_runs
from uav_bt.tree.loading.findings import Findings
from uav_bt.tree.loading.models import read_enumerations
from uav_bt.tree.loading.source import Element, parse_source, read_source
from uav_bt.tree.scripted import AnswerScript
from uav_bt.tree.status import Status

TICKS: Final = PROJECTS / "engine_ticks.yaml"
_LEAVES: Final = {"Action", "Condition"}
_OTHERS: Final = {"Control", "Decorator"}


class Rewriting:
    """Converts a project's files to files that the engine can tick."""

    def __init__(self, run: Run) -> None:
        self._script = run.script
        self._kinds: dict[str, str] = {}
        for model in _all(parse_source(read_source(run.palette), run.palette)):
            if model.tag in _LEAVES | _OTHERS and "ID" in model.attributes:
                self._kinds.setdefault(model.attributes["ID"], model.tag)
        findings, self._members = Findings(), dict[str, int]()
        for path in run.files:
            for each in parse_source(read_source(path), path).children:
                if each.tag == "TreeNodesModel":
                    read_enumerations(each, self._members, findings)
        self.leaves = {name: kind for name, kind in self._kinds.items() if kind in _LEAVES}

    def text(self, path: Path) -> str:
        """Return a file without its includes and its models of leaves."""
        root = parse_source(read_source(path), path)
        written = ET.Element("root", {"BTCPP_format": "4"})
        for child in root.children:
            if child.tag == "BehaviorTree":
                written.append(self._copy(child))
            elif child.tag == "TreeNodesModel":
                models = ET.SubElement(written, "TreeNodesModel")
                models.extend(self._copy(each) for each in child.children if each.tag == "SubTree")
        return ET.tostring(written, encoding="unicode")

    def _copy(self, element: Element) -> ET.Element:
        given = {key: self._numbered(value) for key, value in element.attributes.items()}
        explicit = element.tag in _LEAVES | _OTHERS and "ID" in given
        tag = given.pop("ID") if explicit else element.tag
        kind = self._kinds.get(tag)
        if kind in _LEAVES:
            return self._leaf(tag, given)
        children = [self._copy(child) for child in element.children]
        if kind in _OTHERS:
            return self._stand_in(tag, given, children)
        copied = ET.Element(tag, given)
        copied.extend(children)
        return copied

    def _numbered(self, text: str) -> str:
        """Return a text in which the members of registered enumerations are numbers."""
        for name, value in self._members.items():
            text = re.sub(rf"\b{name}\b", str(value), text)
        return text

    def _leaf(self, tag: str, given: dict[str, str]) -> ET.Element:
        kept = {key: value for key, value in given.items() if key == "name" or key[0] == "_"}
        writes = [
            f"{given[port].strip('{}')} := {_literal(value)}"
            for port, value in self._script.get("outputs", {}).get(tag, {}).items()
            if port in given
        ]
        if writes:
            kept["_onSuccess"] = "; ".join([*writes, *filter(None, [kept.get("_onSuccess")])])
        return ET.Element(tag, kept)

    def _stand_in(self, tag: str, given: dict[str, str], children: list[ET.Element]) -> ET.Element:
        entry = self._script.get("nodes", {}).get(tag)
        if entry is None:  # the node is in a tree that this run does not tick
            return ET.Element("AlwaysSuccess")
        if entry == "pass":
            return children[0]
        ports = dict(entry) if isinstance(entry, Mapping) else {"is": entry}
        stand_in = ET.Element(str(ports.pop("is")), {key: str(ports[key]) for key in ports})
        stand_in.set("name", given.get("name", tag))
        if stand_in.tag == "RetryUntilSuccessful" and len(children) > 1:
            attempt = ET.Element("Fallback")
            attempt.append(children[0])
            ET.SubElement(ET.SubElement(attempt, "ForceFailure"), "Sequence").extend(children[1:])
            children = [attempt]
        stand_in.extend(children)
        return stand_in


def recorded(engine: Any, run: Run) -> list[str]:
    """Return the ticks of a run: the root's status, then each leaf with its answer."""
    rewriting, factory = Rewriting(run), engine.BehaviorTreeFactory()
    ticked: list[str] = []
    counts = Counter[int]()
    answers = run.script.get("leaves", {})

    def answers_by(node_id: str) -> Callable[[Any], Any]:
        def answer(node: Any) -> Any:
            text = answers.get(node.name(), answers.get(node_id, run.script.get("default")))
            status = AnswerScript.parse(text).answer(counts[node.uid()])
            counts[node.uid()] += 1
            ticked.append(f"{node.name()} {status.name}")
            return getattr(engine.NodeStatus, status.name)

        return answer

    for node_id, kind in rewriting.leaves.items():
        answer = answers_by(node_id)
        if kind == "Condition":
            factory.register_simple_condition(node_id, answer)
        else:
            factory.register_simple_stateful_action(node_id, answer, answer, lambda _: None)
    for path in run.files:
        factory.register_behavior_tree_from_text(rewriting.text(path))
    board = engine.Blackboard.create()
    given = {**run.script.get("variables", {}), **run.script.get("board", {})}
    for name, value in given.items():
        kinds = {bool: board.set_bool, str: board.set_string}
        kinds.get(type(value), board.set_double)(name, value)
    tree = factory.create_tree(run.tree_id, board)
    lines = []
    for _ in range(run.ticks):
        ticked.clear()
        status = str(tree.tick_exactly_once()).rpartition(".")[2]
        lines.append(", ".join([status, *ticked]))
        if Status[status] is not Status.RUNNING:
            break
    return lines


def _all(element: Element) -> list[Element]:
    return [element, *(each for child in element.children for each in _all(child))]


def _literal(value: object) -> str:
    return f"'{value}'" if isinstance(value, str) else str(value).lower()


def main() -> None:
    """Record all runs."""
    engine = importlib.import_module("behaviortreepy")
    ticks = {run.label: recorded(engine, run) for run in read_runs()}
    TICKS.write_text(yaml.safe_dump(ticks, sort_keys=False, width=100), encoding="utf-8")


if __name__ == "__main__":
    main()
