"""The branches of a tree file: the possible outcomes of each of its nodes.

A branch is a node with an outcome. Which outcomes a node has follows from its kind, its conditions
and the outcomes of its children: a `Sequence` of leaves that never fail does not fail either, so
that branch is not counted.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from uav_bt.tree import Leaf, NodeKind, NodeRegistry, Status
from uav_bt.tree.loading.document import Document, outline
from uav_bt.tree.loading.elements import node_id_of, tree_within
from uav_bt.tree.loading.findings import Findings, Position
from uav_bt.tree.loading.source import Element, parse_source, read_source, walk


class Outcome(enum.Enum):
    """The outcome of a node's activation."""

    SUCCESS = "SUCCESS"
    FAILURE = "FAILURE"
    SKIPPED = "SKIPPED"
    HALTED = "HALTED"


@dataclass(frozen=True, kw_only=True)
class NodeBranches:
    """A node of a tree file with its outcomes."""

    position: Position
    label: str  # how messages name the node
    outcomes: frozenset[Outcome]


_S: Final = frozenset({Outcome.SUCCESS})
_F: Final = frozenset({Outcome.FAILURE})
_K: Final = frozenset({Outcome.SKIPPED})
_H: Final = frozenset({Outcome.HALTED})
_NONE: Final[frozenset[Outcome]] = frozenset()

# Outcomes of a leaf's answers: one that runs can be halted.
_OUTCOMES: Final = {
    Status.SUCCESS: Outcome.SUCCESS,
    Status.FAILURE: Outcome.FAILURE,
    Status.SKIPPED: Outcome.SKIPPED,
    Status.RUNNING: Outcome.HALTED,
}

_Outcomes = frozenset[Outcome]
_Rule = Callable[[Element, list[_Outcomes]], _Outcomes]


def _any(children: list[_Outcomes]) -> _Outcomes:
    return frozenset().union(*children)


def _all_skipped(children: list[_Outcomes]) -> _Outcomes:
    return _K if all(child >= _K for child in children) else _NONE


def _sequence(_element: Element, children: list[_Outcomes]) -> _Outcomes:
    succeeds = all(child & (_S | _K) for child in children) and _any(children) >= _S
    return (_S if succeeds else _NONE) | (_any(children) & _F) | _all_skipped(children)


def _fallback(_element: Element, children: list[_Outcomes]) -> _Outcomes:
    fails = all(child & (_F | _K) for child in children) and _any(children) >= _F
    return (_F if fails else _NONE) | (_any(children) & _S) | _all_skipped(children)


def _parallel(_element: Element, children: list[_Outcomes]) -> _Outcomes:
    return (_any(children) & (_S | _F)) | _all_skipped(children)


def _choice(_element: Element, children: list[_Outcomes]) -> _Outcomes:
    """IfThenElse, WhileDoElse: the first child chooses between the others."""
    if len(children) < 2:
        return _S | _F  # the loader refuses this, too
    asked, yes = children[0], children[1]
    no = children[2] if len(children) > 2 else _F
    return (yes if asked >= _S else _NONE) | (no if asked >= _F else _NONE)


def _inverter(_element: Element, children: list[_Outcomes]) -> _Outcomes:
    child = children[0]
    return (_F if child >= _S else _NONE) | (_S if child >= _F else _NONE) | (child & _K)


def _ended(child: _Outcomes, forced: _Outcomes) -> _Outcomes:
    return (forced if child & (_S | _F) else _NONE) | (child & _K)


def _endless(element: Element, port: str, outcome: _Outcomes) -> _Outcomes:
    return outcome if element.attributes.get(port, "").strip() == "-1" else _NONE


def _run_once(element: Element, children: list[_Outcomes]) -> _Outcomes:
    skips = element.attributes.get("then_skip", "true").strip().lower() not in {"false", "0"}
    return children[0] | (_K if skips else _NONE)


def _timeout(element: Element, children: list[_Outcomes]) -> _Outcomes:
    return children[0] | (_NONE if element.attributes.get("msec", "").strip() == "0" else _F)


def _loop(element: Element, children: list[_Outcomes]) -> _Outcomes:
    return (children[0] & _F) | _literal(element.attributes.get("if_empty", "SUCCESS"))


def _literal(text: str) -> _Outcomes:
    return frozenset(outcome for outcome in Outcome if outcome.value == text.strip())


_RULES: Final[dict[str, _Rule]] = {
    **dict.fromkeys(
        ("Sequence", "AsyncSequence", "ReactiveSequence", "SequenceWithMemory"), _sequence
    ),
    **dict.fromkeys(("Fallback", "AsyncFallback", "ReactiveFallback"), _fallback),
    **dict.fromkeys(("Parallel", "ParallelAll"), _parallel),
    **dict.fromkeys(("IfThenElse", "WhileDoElse"), _choice),
    **dict.fromkeys(
        ("Switch2", "Switch3", "Switch4", "Switch5", "Switch6"), lambda _, found: _any(found)
    ),
    **dict.fromkeys(("LoopBool", "LoopDouble", "LoopInt", "LoopString"), _loop),
    **dict.fromkeys(("Delay", "WaitValueUpdate"), lambda _, found: found[0]),
    "TryCatch": lambda element, found: _sequence(element, found[:-1]),
    "Inverter": _inverter,
    "ForceSuccess": lambda _, found: _ended(found[0], _S),
    "ForceFailure": lambda _, found: _ended(found[0], _F),
    "KeepRunningUntilFailure": lambda _, found: found[0] & _F,
    "Repeat": lambda element, found: found[0] - _endless(element, "num_cycles", _S),
    "RetryUntilSuccessful": lambda element, found: found[0] - _endless(element, "num_attempts", _F),
    "RunOnce": _run_once,
    "Timeout": _timeout,
    "SkipUnlessUpdated": lambda _, found: found[0] | _K,
    "Precondition": lambda element, found: (
        found[0] | _literal(element.attributes.get("else", "FAILURE"))
    ),
}

# The outcomes that a condition attribute adds to its node.
_ADDED: Final[dict[str, _Outcomes]] = {
    "_successIf": _S,
    "_failureIf": _F,
    "_skipIf": _K,
    "_while": _K,
}


class _Analysis:
    """Derives the outcomes of a document's nodes."""

    def __init__(self, document: Document, kinds: Mapping[str, NodeKind]) -> None:
        self._document = document
        self._kinds = kinds
        self._open: set[str] = set()  # trees that are being analysed, against endless recursion

    def outcomes(self, element: Element) -> _Outcomes:
        found = self._own(element)
        for attribute, added in _ADDED.items():
            if attribute in element.attributes:
                found |= added
        return found

    def _own(self, element: Element) -> _Outcomes:
        tree_id = tree_within(element, self._document.registry)
        if tree_id is not None:
            return self._subtree(tree_id)
        node_id = node_id_of(element)
        if not element.children:
            return self._leaf(element, node_id)
        # The halt of a node that has children is the halt of the leaf that runs below it.
        children = [self.outcomes(child) - _H for child in element.children]
        rule = _RULES.get(node_id)
        return _S | _F if rule is None else rule(element, children)

    def _leaf(self, element: Element, node_id: str) -> _Outcomes:
        written = NodeKind.CONDITION if element.tag == NodeKind.CONDITION.value else NodeKind.ACTION
        kind = self._kinds.get(node_id, written)
        node = self._document.registry.get(node_id)
        if node is not None and issubclass(node, Leaf) and node.kind is kind:
            return frozenset(_OUTCOMES[answer] for answer in node.answers)
        return _S | _F if kind is NodeKind.CONDITION else _S | _F | _H

    def _subtree(self, tree_id: str) -> _Outcomes:
        tree = self._document.trees.get(tree_id)
        if tree is None or not tree.children or tree_id in self._open:
            return _S | _F
        self._open.add(tree_id)
        found = self.outcomes(tree.children[0]) - _H
        self._open.discard(tree_id)
        return found


def tree_branches(
    path: Path, registry: NodeRegistry, kinds: Mapping[str, NodeKind] | None = None
) -> list[NodeBranches]:
    """Return all nodes of a file with their outcomes, in the order of the file.

    Nodes of included files are left out. The file need not load with the registry: an unknown node
    without children counts as a leaf, and a subtree without its tree can succeed and fail.

    Args:
        path: the file.
        registry: node classes, for the kinds of leaves.
        kinds: further kinds by node id, with precedence over the registry.

    Raises:
        TreeError: the file has no trees, or cannot be read.
    """
    findings = Findings()
    document = outline(parse_source(read_source(path), path), registry, findings)
    if not document.trees:
        findings.add(path, Position(1, 1), "the file has no BehaviorTree")
        findings.raise_any(path)
    known = {node_id: registry[node_id].kind for node_id in registry}
    analysis = _Analysis(document, {**known, **(kinds or {})})
    elements = [
        element for tree in document.trees.values() if tree.path == path for element in walk(tree)
    ]
    found = [
        NodeBranches(
            position=element.position,
            label=element.label,
            outcomes=analysis.outcomes(element),
        )
        for element in elements
    ]
    return sorted(found, key=lambda node: node.position)
