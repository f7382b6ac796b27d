"""Coverage of the branches of tree files over a test run."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from uav_bt.errors import TreeError
from uav_bt.testing.branches import NodeBranches, Outcome, tree_branches
from uav_bt.tree import MissionTree, Node, NodeKind, NodeRegistry
from uav_bt.tree.observer import NodeEvent, observe

_OUTCOMES: Final = {
    NodeEvent.STARTED: "TICKED",
    NodeEvent.RAN: "TICKED",
    NodeEvent.RAISED: "TICKED",
    NodeEvent.SUCCEEDED: Outcome.SUCCESS.value,
    NodeEvent.FAILED: Outcome.FAILURE.value,
    NodeEvent.SKIPPED: Outcome.SKIPPED.value,
    NodeEvent.HALTED: Outcome.HALTED.value,
}


@dataclass(frozen=True, kw_only=True)
class FileCoverage:
    """The coverage of one tree file."""

    path: Path
    nodes: int = 0
    ticked: int = 0
    branches: int = 0
    taken: int = 0
    missing: tuple[str, ...] = ()  # a line for each node with branches that were not taken
    refused: str = ""  # why the file could not be measured

    @property
    def percent(self) -> int:
        """Branches that were taken, in whole percent; 100 only when none is missing."""
        return percentage([self])


def percentage(files: Iterable[FileCoverage]) -> int:
    """Return the branches that were taken in several files, in whole percent, rounded down."""
    files = list(files)
    # A file that cannot be measured counts as one branch that was not taken.
    branches = sum(1 if file.refused else file.branches for file in files)
    taken = sum(file.taken for file in files)
    return 100 if not branches else math.floor(100 * taken / branches)


class TreeCoverage:
    """Watches the trees that are made from some files, over a whole test run.

    Nodes are identified by their position in the file, so that a subtree that is used in several
    places counts once.

    Args:
        files: the files.
    """

    def __init__(self, files: Sequence[Path]) -> None:
        self._files = {path.resolve(): path for path in files}
        self._seen: dict[Path, dict[str, set[str]]] = {path: {} for path in self._files}
        self._kinds: dict[str, NodeKind] = {}

    def watch(self, tree: MissionTree) -> None:
        """Watch a tree from now on, if it comes from one of the files."""
        seen = dict(self._places(tree))
        if not seen:
            return
        nodes = [node for node in tree.nodes() if node.path in seen]
        self._kinds |= {node.node_id: node.kind for node in nodes}

        def note(node: Node, event: NodeEvent) -> None:
            if event in _OUTCOMES:
                seen[node.path].add(_OUTCOMES[event])

        observe(nodes, note)

    def _places(self, tree: MissionTree) -> Iterator[tuple[str, set[str]]]:
        resolved: dict[Path, Path] = {}
        for node_path, place in tree.places.items():
            path = resolved.setdefault(place.path, place.path.resolve())
            if path in self._seen:
                yield node_path, self._seen[path].setdefault(str(place.position), set())

    # --- between processes ------------------------------------------------------------------------

    def export(self) -> dict[str, Any]:
        """Return the results as plain values, for another process to merge."""
        return {
            "seen": {
                str(path): {at: sorted(outcomes) for at, outcomes in places.items()}
                for path, places in self._seen.items()
            },
            "kinds": {node_id: kind.value for node_id, kind in self._kinds.items()},
        }

    def merge(self, exported: Mapping[str, Any]) -> None:
        """Add the results of another process."""
        for text, places in exported["seen"].items():
            seen = self._seen.setdefault(Path(text), {})
            for at, outcomes in places.items():
                seen.setdefault(at, set()).update(outcomes)
        for node_id, kind in exported["kinds"].items():
            self._kinds[node_id] = NodeKind(kind)

    # --- the result -------------------------------------------------------------------------------

    def results(self, registry: NodeRegistry) -> list[FileCoverage]:
        """Return the coverage of each file.

        Args:
            registry: node classes, for the kinds of leaves that no test has ticked.
        """
        return [self._result(path, shown, registry) for path, shown in self._files.items()]

    def _result(self, path: Path, shown: Path, registry: NodeRegistry) -> FileCoverage:
        try:
            nodes = tree_branches(path, registry, self._kinds)
        except TreeError as error:
            return FileCoverage(path=shown, refused=str(error))
        seen = self._seen[path]
        ticked = taken = 0
        missing: list[str] = []
        for node in nodes:
            found = seen.get(str(node.position), set())
            ticked += bool(found)
            left = {outcome.value for outcome in node.outcomes} - found
            taken += len(node.outcomes) - len(left)
            if left or not found:
                missing.append(_line(shown, node, left, never=not found))
        return FileCoverage(
            path=shown,
            nodes=len(nodes),
            ticked=ticked,
            branches=sum(len(node.outcomes) for node in nodes),
            taken=taken,
            missing=tuple(missing),
        )


def _line(path: Path, node: NodeBranches, left: set[str], *, never: bool) -> str:
    where = f"{path}:{node.position}: {node.label}"
    if never:
        return f"{where}: never ticked"
    names = [outcome.value for outcome in Outcome if outcome.value in left]
    return f"{where}: never {', '.join(names)}"
