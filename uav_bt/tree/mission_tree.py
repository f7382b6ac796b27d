"""Mission trees: set-up, tick, halt and the running branch."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from py_trees.behaviour import Behaviour

from uav_bt.board.context import MissionContext
from uav_bt.errors import InputError, MissionError, NodeFailedError, UavBtError
from uav_bt.tree.foreign import PyTreesRoot
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.findings import Placed, Position
from uav_bt.tree.node import Node
from uav_bt.tree.script.values import ONLY_LEAVES_WRITE
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SUCCESS, Status
from uav_bt.tree.variables import Variables


@dataclass(frozen=True)
class Place:
    """Where a tree file has a node."""

    path: Path  # of the file; with includes, the included one
    position: Position

    def __str__(self) -> str:
        """Return `file:line:column`."""
        return f"{self.path}:{self.position}"


_FRAMES_PER_LEVEL: Final = 8  # of Python's, in a tick that is watched, asks conditions and halts
_FRAMES_OF_OTHERS: Final = 500  # what calls the tree, and what its leaves call


def allow_depth(levels: int) -> None:
    """Raise Python's limit of 1000 nested calls to the need of a tick of such a tree."""
    needed = levels * _FRAMES_PER_LEVEL + _FRAMES_OF_OTHERS
    sys.setrecursionlimit(max(sys.getrecursionlimit(), needed))


class MissionTree:
    """A tree of nodes with its variables.

    Args:
        root: the root node, or the root of a tree of py_trees; it and all below belong to this
            tree from now on.
        name: the tree's name, first part of all paths.

    Attributes:
        sources: the texts of the tree file and of the files it takes trees from, by path, the tree
            file first; empty for a tree composed in Python.
        whole: writes one tree file with all that the tree takes from these.
        places: where the tree file has the nodes, by path; empty for a tree composed in Python.
        replaced: attribute values that replace those of the tree file, by path.
    """

    def __init__(self, root: Node | Behaviour, *, name: str = "Tree") -> None:
        self.root = root if isinstance(root, Node) else PyTreesRoot(root)
        self.name = name
        self.sources: dict[Path, bytes] = {}
        self.whole: Callable[[], bytes] = bytes
        self.places: dict[str, Placed] = {}
        self.replaced: dict[str, dict[str, str]] = {}
        self.variables = Variables()
        self._ready = False
        counts = Counter(self.nodes())
        if (twice := next((node for node in counts if counts[node] > 1), None)) is not None:
            raise InputError(
                f"node '{twice.name}' stands in tree '{name}' {counts[twice]} times: make an "
                "object for each of its places"
            )
        self.root.place(f"{name}/{self.root.name}", self.variables)
        allow_depth(max(node.path.count("/") for node in self.nodes()))

    def __repr__(self) -> str:
        origin = str(self.path) if self.sources and self.path.is_file() else self.origin
        return f"<MissionTree '{self.name}': {sum(1 for _ in self.nodes())} nodes, {origin}>"

    def _repr_svg_(self) -> str:
        """Return the drawing that a notebook shows."""
        from uav_bt.tree.describe import render  # noqa: PLC0415 - only notebooks draw

        return render(self.root, self.name, "svg")

    @property
    def path(self) -> Path:
        """The tree file; for a tree composed in Python what its name would be."""
        return next(iter(self.sources), Path(f"{self.name}.xml"))

    @property
    def origin(self) -> str:
        """Name of the tree in reports and records: its file's name, or that it has none."""
        return self.path.name if self.sources else f"{self.name} (composed in Python)"

    @property
    def is_set_up(self) -> bool:
        """Whether nodes of it were set up for a mission. A tree flies once: leaves keep state."""
        return any(node.has_mission for node in self.nodes())

    @property
    def text(self) -> str:
        """The tree file's own text; empty for a tree composed in Python."""
        return next(iter(self.sources.values()), b"").decode(errors="replace")

    def nodes(self) -> Iterator[Node]:
        """Iterate over all nodes in the order of the file, parents first."""
        stack = [self.root]
        while stack:
            node = stack.pop()
            yield node
            stack.extend(reversed(node.children))

    def leaves(self) -> Iterator[Leaf]:
        """Iterate over all leaves in the order of the file."""
        return (node for node in self.nodes() if isinstance(node, Leaf))

    def find(self, name: str) -> Node:
        """Return the node of a path, or the only node of a name.

        Raises:
            KeyError: no node or several nodes have that name.
        """
        hits = [node for node in self.nodes() if name in (node.path, node.name)]
        if len(hits) != 1:
            raise KeyError(f"{len(hits)} nodes are called '{name}'")
        return hits[0]

    def setup(self, context: MissionContext) -> None:
        """Set all nodes up for a mission; where a leaf raises, those before it are shut down.

        Raises:
            InputError: a leaf cannot use a value given to it (a missing file, an unknown policy).
            NodeFailedError: another exception in a leaf's `on_setup`.
        """
        for leaf in self.leaves():
            for key in (*leaf.reads, *leaf.writes):
                context.board.declare(key)
        for node in self.nodes():  # in a file, the loader has refused such scripts
            for name in (name for _, script in node.scripts() for name in script.board_writes):
                what = f"node '{node.path}': '@{name}' is a board key"
                raise InputError(f"{what}; {ONLY_LEAVES_WRITE}")
        try:
            for node in self.nodes():
                node.setup(mission=context)
        except UavBtError as failure:
            try:
                self.shutdown()
            except NodeFailedError as second:
                failure.add_note(f"while shutting the tree down, also: {second}")
            raise
        self._ready = True

    def shutdown(self) -> None:
        """Shut all nodes down; of several that raise, the first error is raised at the end."""
        _for_all(self.nodes(), lambda node: node.shutdown())

    def inherit(self, former: MissionTree) -> None:
        """Hand the leaves the knowledge of a tree, halted, that this one replaces in flight.

        The first leaf of a class goes on from the first of that class there, and so on.
        """
        leaves = list(former.leaves())
        for leaf in self.leaves():
            alike = next((other for other in leaves if type(other) is type(leaf)), None)
            if alike is not None:
                leaves.remove(alike)
                with leaf.failing():
                    leaf.on_inherit(alike)

    def tick(self) -> Status:
        """Tick exactly once.

        Returns:
            SUCCESS, FAILURE, RUNNING, or SKIPPED when the root was skipped.

        Raises:
            NodeFailedError: an exception in a node; nothing is running any more.
            MissionError: the tree was not set up.
        """
        if not self._ready:
            raise MissionError(f"tree '{self.name}' is not set up: call setup(context) first")
        root = self.root
        if root.node_status is SUCCESS or root.node_status is FAILURE:
            root.reset()
        try:
            return root.execute_tick()
        except NodeFailedError as failure:
            try:
                self.halt()
            except NodeFailedError as second:
                failure.add_note(f"while halting the tree, also: {second}")
            raise

    def halt(self) -> None:
        """Stop whatever runs; `terminate` of every running leaf is called, even if another raises.

        Raises:
            NodeFailedError: a leaf's `terminate` raised; the first of them, when all are halted.
        """
        if self.root.node_status is not RUNNING:
            self.root.set_status(IDLE)  # to the engine a finished root is idle at once
        try:
            # As the engine does: the root, which passes it on, and then each node by itself, for
            # those that it did not reach. `_onHalted` scripts of all nodes are run.
            _for_all((self.root, *self.nodes()), lambda node: node.halt())
        finally:
            for node in self.nodes():
                node.set_status(IDLE)

    def active_nodes(self) -> tuple[Node, ...]:
        """Return the nodes along the running branch, from the root down; empty when idle."""
        nodes: list[Node] = []
        running = [self.root] if self.root.node_status is RUNNING else []
        while running:
            # Of several, the last one: the mission comes after the perception that feeds it.
            nodes.append(running[-1])
            running = [each for each in nodes[-1].children if each.node_status is RUNNING]
        return tuple(nodes)

    def active_path(self) -> tuple[str, ...]:
        """Return the names along the running branch, from the root down; empty when idle."""
        return tuple(node.name for node in self.active_nodes())


def _for_all(nodes: Iterable[Node], act: Callable[[Node], None]) -> None:
    """Act on all nodes, then raise the first error."""
    first: NodeFailedError | None = None
    for node in nodes:
        try:
            act(node)
        except NodeFailedError as error:
            first = first or error
    if first is not None:
        raise first
