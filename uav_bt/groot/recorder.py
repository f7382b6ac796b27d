"""Every change of every node's status, noted while it happens, of a tree that is watched.

A tree that nobody watches pays nothing: its nodes have no hook to ask. A watched node is given,
while it is watched, a subclass of its own class that notices assignments to `status`. So the notes
are those that the engine's own loggers get, in their order, whatever a node does in its tick: a
node that starts and ends in one tick leaves a RUNNING (where it has one), a result and an IDLE.
SKIPPED leaves nothing, as with the engine: it is an answer, never a status that a node stands in.
"""

from __future__ import annotations

import types
from collections.abc import Callable
from functools import lru_cache, partial
from types import TracebackType
from typing import Any, Final, Self

from uav_bt.errors import MissionError
from uav_bt.groot.numbering import TreeNumbering
from uav_bt.groot.transitions import STATUS_CODES, Transition
from uav_bt.protocols import Clock
from uav_bt.tree import Node
from uav_bt.tree.status import FAILURE, IDLE, SUCCESS, Status

__all__ = ["TransitionRecorder"]

_CHANGED: Final = "_status_changed"  # where a watched node keeps whom to tell
# By identity: hashing a member of an enumeration is a call in Python.
_CODES: Final = {id(status): code for status, code in STATUS_CODES.items()}
_ROOT_UID: Final = 1


class _Watched:
    """Marks the classes of watched nodes."""

    __slots__ = ()


@lru_cache(maxsize=1024)
def _watched(plain: type[Node]) -> type[Node]:
    """Return the subclass of a node class that notices; of the same layout and name."""
    assign = plain.__setattr__

    def notice(self: Any, name: str, value: Any) -> None:
        # Through attributes, not `__dict__`: asking for that makes an object slower for good.
        if name == "status" and self.status is not value:
            self._status_changed(value)
        assign(self, name, value)

    body = {
        "__slots__": (),
        "__module__": plain.__module__,
        "__qualname__": plain.__qualname__,
        "__doc__": plain.__doc__,
        "__setattr__": notice,
        "node_id": plain.node_id,
    }
    # The marker stands last, so that the layout is the node class's.
    watched: type[Node] = types.new_class(
        plain.__name__, (plain, _Watched), exec_body=lambda names: names.update(body)
    )
    watched.kind = plain.kind  # node classes work theirs out anew when they are subclassed
    return watched


class TransitionRecorder:
    """Notes a tree's transitions from when it is attached until it is detached.

    Use it as a context manager, or attach and detach it.

    Args:
        numbering: of the tree.
        clock: the mission's; it dates the transitions.
    """

    def __init__(self, numbering: TreeNumbering, clock: Clock) -> None:
        self._numbering = numbering
        self._now_s: Callable[[], float] = clock.now
        self._noted: list[tuple[float, int, Status]] = []  # seconds, uid; put in form by `take`
        self._root_ended = False

    def attach(self) -> None:
        """Begin to note.

        Raises:
            MissionError: somebody else watches the tree.
        """
        nodes = self._numbering.nodes
        if any(isinstance(node, _Watched) for node in nodes):
            raise MissionError(f"tree node '{nodes[0].path}' is being watched already")
        for uid, node in enumerate(nodes, 1):
            note = self._note_root if uid == _ROOT_UID else partial(self._note, uid)
            setattr(node, _CHANGED, note)
            node.__class__ = _watched(type(node))

    def detach(self) -> None:
        """Leave the tree as it was; what was noted can still be taken. Safe to call twice."""
        for node in self._numbering.nodes:
            if isinstance(node, _Watched):
                node.__class__ = type(node).__mro__[1]
                delattr(node, _CHANGED)

    def take(self) -> list[Transition]:
        """Return what was noted since the last call; called after a tick, and at the end.

        To the engine a root that finished is idle as soon as its tick is over, while our trees
        reset it when they are ticked again; here the engine's order is kept.
        """
        root = self._numbering.nodes[0]
        if not self._root_ended and (root.status is SUCCESS or root.status is FAILURE):
            self._note(_ROOT_UID, IDLE)
            self._root_ended = True
        noted, self._noted = self._noted, []
        return [
            Transition(round(time_s * 1e6), uid, _CODES[id(status)])
            for time_s, uid, status in noted
        ]

    def __enter__(self) -> Self:
        """Attach."""
        self.attach()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Detach."""
        self.detach()

    def _note(self, uid: int, status: Status) -> None:
        self._noted.append((self._now_s(), uid, status))

    def _note_root(self, status: Status) -> None:
        told, self._root_ended = self._root_ended, False
        if not (told and status is IDLE):
            self._note(_ROOT_UID, status)
