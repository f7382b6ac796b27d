"""A tree of py_trees as the root of a mission."""

from __future__ import annotations

from collections.abc import Iterator

from py_trees import common
from py_trees.behaviour import Behaviour

from uav_bt.errors import InputError, NodeFailedError
from uav_bt.tree.foreign import no_status, warn_of_wall_clock
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.status import Status


class PyTreesRoot(Node):
    """Ticks a tree of py_trees, in which nodes of ours may stand.

    Composites of py_trees tick by the rules of py_trees. Their behaviours are set up as by
    `BehaviourTree.setup(mission=...)`: `setup(**kwargs)` gets the `MissionContext` as `mission`.
    The children of this node are the nodes of ours, each below the root's path; the behaviours of
    py_trees between them are no nodes and have no events.

    Args:
        root: root of the tree of py_trees.

    Raises:
        InputError: the root stands below another behaviour.
    """

    kind = NodeKind.CONTROL
    max_children = None

    def __init__(self, root: Behaviour) -> None:
        if root.parent is not None:
            raise InputError(
                f"behaviour '{root.name}' stands below '{root.parent.name}': give the root of the "
                "tree"
            )
        super().__init__(root.name)
        self.behaviour = root
        self.children = list(_uppermost(root))  # their parents stay those of py_trees
        self._set_up: list[Behaviour] = []
        self._active = False  # ticked and still running

    @property
    def author(self) -> type:
        """The class of the root."""
        return type(self.behaviour)

    def _setup(self) -> None:
        for behaviour in _foreign(self.behaviour):
            behaviour.setup(mission=self.mission)
            self._set_up.append(behaviour)
        warn_of_wall_clock(self.path, self._set_up)

    def shutdown(self) -> None:
        """Shut the behaviours of py_trees down, also where an earlier one raises.

        Raises:
            NodeFailedError: a behaviour raised; the first of them.
        """
        first: NodeFailedError | None = None
        while self._set_up:
            behaviour = self._set_up.pop(0)
            try:
                behaviour.shutdown()
            except Exception as error:  # noqa: BLE001  (raised below, when all are shut down)
                first = first or NodeFailedError(self.path, error, type(behaviour))
        if first is not None:
            raise first

    def update(self) -> Status:
        """Tick the tree of py_trees and return the answer of its root.

        Raises:
            MissionError: a behaviour of py_trees answered INVALID or something else than a status.
        """
        self._active = True
        for ticked in self.behaviour.tick():
            if not isinstance(ticked, Node) and ticked.status is common.Status.INVALID:
                raise no_status(ticked, "INVALID or another value")
        self.feedback_message = self.behaviour.feedback_message
        status = Status[self.behaviour.status.name]
        self._active = status is Status.RUNNING
        return status

    def _halt(self) -> None:
        if self._active:
            self._active = False
            self.behaviour.stop(common.Status.INVALID)
        super()._halt()


def _uppermost(behaviour: Behaviour) -> Iterator[Node]:
    """Yield the nodes of ours that stand directly below behaviours of py_trees."""
    for child in behaviour.children:
        if isinstance(child, Node):
            yield child
        else:
            yield from _uppermost(child)


def _foreign(behaviour: Behaviour) -> Iterator[Behaviour]:
    """Yield the behaviours of py_trees, children first, as py_trees sets them up."""
    return (each for each in behaviour.iterate() if not isinstance(each, Node))
