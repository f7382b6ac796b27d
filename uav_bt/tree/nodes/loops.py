"""Loops over the elements of a queue."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, MutableSequence
from dataclasses import replace
from typing import Any, ClassVar

from uav_bt.errors import BoardAccessError
from uav_bt.tree.flow import After, Follow, Known, Written, answered, joined
from uav_bt.tree.node import Node
from uav_bt.tree.nodes.base import DecoratorNode
from uav_bt.tree.port import Port
from uav_bt.tree.status import ANSWER_NAMES, FAILURE, IDLE, RUNNING, Status
from uav_bt.types.place import FILE_PREFIX, SEPARATOR, Place

IF_EMPTY = Port(
    "if_empty", str, default="SUCCESS", doc="the answer when nothing is left", choices=ANSWER_NAMES
)


def _split(value: Port[Any], text: str) -> list[Any]:
    if not text:
        return []
    return [value.convert(part) for part in text.removesuffix(SEPARATOR).split(SEPARATOR)]


def _queue(value: Port[Any]) -> Port[Any]:
    def check(queue: object) -> None:
        for part in _split(value, queue) if isinstance(queue, str) else ():
            if isinstance(part, str) and part.strip().startswith(FILE_PREFIX):
                Place.parse(part)  # refuses the file, which the loader has not replaced

    doc = "elements as 1;2;3, or {variable} with such a text, or with a list, which is used up"
    is_text = value.type is str
    if is_text:
        doc += "; file:rounds.csv stands for the places of a file"
    takes = (str, MutableSequence)
    return Port("queue", object, doc=doc, check=check, takes=takes, places=is_text)


class _Loop(DecoratorNode):
    """Ticks its child once for each element.

    A queue written as `1;2;3`, here or in a variable, is gone through again at each activation; a
    list in a variable is used up.
    """

    QUEUE: ClassVar[Port[Any]]
    VALUE: ClassVar[Port[Any]]

    ticks_again = True

    def __init_subclass__(cls, *, element: type, **kwargs: Any) -> None:
        cls.VALUE = Port("value", element, doc="where the element goes", direction="output")
        cls.QUEUE = _queue(cls.VALUE)
        cls.ports = (cls.QUEUE, IF_EMPTY, cls.VALUE)
        super().__init_subclass__(**kwargs)

    def __init__(self, name: str | None, child: Node, /, **given: object) -> None:
        super().__init__(name, child, **given)
        self._busy = False  # the child runs: no new element until it ends
        self._own: deque[Any] | None = None  # of a text; None: the variable's list

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Follow the child, which may not run."""
        after = follow(self.child, known)
        return joined(after, answered(known, self.literals.get(IF_EMPTY.name)))

    def update(self) -> Status:
        """Tick the child."""
        if self.node_status is IDLE:
            self._busy = False
            text = self.held(self.QUEUE)
            self._own = deque(_split(self.VALUE, text)) if isinstance(text, str) else None
        if not self._busy:
            left = self._shared_queue() if self._own is None else self._own
            if not left:
                return Status[self.port(IF_EMPTY)]
            element = left[0]
            del left[0]
            self.set_port(self.VALUE, element)
        if self.node_status is IDLE:
            self.set_status(RUNNING)
        status = self.child.execute_tick()
        self._busy = status is RUNNING
        return FAILURE if status is FAILURE else RUNNING

    def _shared_queue(self) -> MutableSequence[Any] | None:
        value = self.held(self.QUEUE)
        if value is None or isinstance(value, MutableSequence):
            return value
        raise BoardAccessError(
            f"node '{self.path}', port 'queue': expected a list, or a text like 1;2;3, got "
            f"{type(value).__name__}"
        )


class LoopBool(_Loop, element=bool):
    """Ticks its child once for each element of a queue of truth values."""


class LoopDouble(_Loop, element=float):
    """Ticks its child once for each element of a queue of numbers."""


class LoopInt(_Loop, element=int):
    """Ticks its child once for each element of a queue of integers."""


class LoopString(_Loop, element=str):
    """Ticks its child once for each element of a queue of texts."""

    def variables_written(self) -> Iterator[Written]:
        """Yield the variable of the element, with the elements where the file has them."""
        at = self.reference(self.QUEUE)
        entry = None if at is None or at.on_board else self.variables.entry(at.key)
        queue = self.literals.get(self.QUEUE.name) if entry is None else entry.value
        texts = queue.removesuffix(SEPARATOR).split(SEPARATOR) if isinstance(queue, str) else ()
        for written in super().variables_written():
            yield replace(written, elements=tuple(texts) if queue else ())
