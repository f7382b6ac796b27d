"""Decorators that change or repeat what their child answers, and loops over queues."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, MutableSequence
from dataclasses import replace
from typing import Any, ClassVar

from uav_bt.errors import BoardAccessError
from uav_bt.tree.node_ports import Written
from uav_bt.tree.nodes.base import DecoratorNode
from uav_bt.tree.port import Port
from uav_bt.tree.status import ANSWER_NAMES, FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Status
from uav_bt.tree.variables import After, Follow, Known, Out, answered, as_child, both, joined
from uav_bt.types.place import FILE_PREFIX, SEPARATOR, Place


class _Translated(DecoratorNode):
    """Ticks its child and maps its answer by a table; other answers are passed on."""

    _answers: ClassVar[Mapping[Status, Status]]

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Follow the child, and map its answers."""
        after = as_child(self, follow, known)
        ends: dict[Status, Out] = dict.fromkeys((SUCCESS, FAILURE, RUNNING))
        for answer, out in ((SUCCESS, after.success), (FAILURE, after.failure)):
            translated = self._answers.get(answer, answer)
            ends[translated] = both(ends[translated], out)
        return After(ends[SUCCESS], ends[FAILURE], after.skipped)

    def update(self) -> Status:
        """Tick the child."""
        self.set_status(RUNNING)
        status = self.child.execute_tick()
        return self._answers.get(status, status)


class Inverter(_Translated):
    """Turns SUCCESS into FAILURE and the other way round."""

    _answers: ClassVar = {SUCCESS: FAILURE, FAILURE: SUCCESS}


class ForceSuccess(_Translated):
    """Answers SUCCESS when its child finishes, however it finishes."""

    _answers: ClassVar = {FAILURE: SUCCESS}


class ForceFailure(_Translated):
    """Answers FAILURE when its child finishes, however it finishes."""

    _answers: ClassVar = {SUCCESS: FAILURE}


class KeepRunningUntilFailure(_Translated):
    """Starts its child again and again until it fails."""

    _answers: ClassVar = {SUCCESS: RUNNING, SKIPPED: RUNNING}
    ticks_again = True


class _Counted(DecoratorNode):
    """Ticks its child until it gives one answer, or the other as often as the first port says."""

    _counts: ClassVar[Status]  # the answer that is counted, and given when the limit is reached
    _ends: ClassVar[Status]  # the answer that ends it at once
    _rereads: ClassVar[bool] = False  # the limit's port after each round

    ticks_again = True

    _done = 0

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Follow the child; without a limit, the counted answer never comes."""
        after = as_child(self, follow, known)
        count = self.literals.get(self.ports[0].name)
        if not count:  # zero, or known in flight only
            return joined(after, After(known, known))
        if count > 0:
            return after
        ends = {SUCCESS: after.success, FAILURE: after.failure, self._counts: None}
        return After(ends[SUCCESS], ends[FAILURE], after.skipped)

    def update(self) -> Status:
        """Tick the child."""
        limit: int = self.port(self.ports[0])
        self.set_status(RUNNING)
        child = self.child
        again = self._done < limit or limit == -1
        while again:
            was_idle = child.node_status is IDLE
            status = child.execute_tick()
            if status is RUNNING:
                return RUNNING
            child.reset()
            if status is SKIPPED:
                return SKIPPED
            if status is self._ends:
                self._done = 0
                return status
            self._done += 1
            if self._rereads:
                limit = self.port(self.ports[0])
            again = self._done < limit or limit == -1
            if was_idle and again:
                return RUNNING
        self._done = 0
        return self._counts

    def _halt(self) -> None:
        self._done = 0
        super()._halt()


class Repeat(_Counted):
    """Repeats its child until it has succeeded the given number of times, or failed once."""

    NUM_CYCLES = Port("num_cycles", int, doc="how many times; -1: without end")
    ports = (NUM_CYCLES,)

    _counts = SUCCESS
    _ends = FAILURE


class RetryUntilSuccessful(_Counted):
    """Tries its child again until it succeeds, or has failed the given number of times."""

    NUM_ATTEMPTS = Port("num_attempts", int, doc="how many times; -1: without end")
    ports = (NUM_ATTEMPTS,)

    _counts = FAILURE
    _ends = SUCCESS
    _rereads = True  # as the engine does: the child may have changed the variable


class RunOnce(DecoratorNode):
    """Runs its child to the end once in the whole mission."""

    THEN_SKIP = Port(
        "then_skip", bool, default=True, doc="afterwards: skip, instead of the same answer again"
    )
    ports = (THEN_SKIP,)

    _answer: Status | None = None

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Follow the child; later it is skipped."""
        after = as_child(self, follow, known)
        ended = both(after.success, after.failure)
        return After(after.success, after.failure, both(after.skipped, ended))

    def update(self) -> Status:
        """Tick the child."""
        if self._answer is not None:
            return SKIPPED if self.port(self.THEN_SKIP) else self._answer
        self.set_status(RUNNING)
        status = self.child.execute_tick()
        if status is SUCCESS or status is FAILURE:
            self._answer = status
        return status


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

    _busy = False  # the child runs: no new element until it ends
    _own: deque[Any] | None = None  # of a text; None: the variable's list

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
