"""Decorators that change or repeat what their child answers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from uav_bt.tree.flow import After, Follow, Known, Out, as_child, both, joined
from uav_bt.tree.nodes.base import DecoratorNode
from uav_bt.tree.port import Port
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Status


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
    """Ticks its child until it gives one answer, or has given the other a number of times."""

    _limit: ClassVar[Port[int]]
    _counts: ClassVar[Status]  # the answer that is counted, and given when the limit is reached
    _ends: ClassVar[Status]  # the answer that ends it at once
    _rereads: ClassVar[bool] = False  # the limit's port after each round

    ticks_again = True

    _done = 0

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Follow the child; without a limit, the counted answer never comes."""
        after = as_child(self, follow, known)
        count = self.literals.get(self._limit.name)
        if not count:  # zero, or known in flight only
            return joined(after, After(known, known))
        if count > 0:
            return after
        counted = self._counts
        return After(
            None if counted is SUCCESS else after.success,
            None if counted is FAILURE else after.failure,
            after.skipped,
        )

    def update(self) -> Status:
        """Tick the child."""
        limit = self.port(self._limit)
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
                limit = self.port(self._limit)
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

    _limit = NUM_CYCLES
    _counts = SUCCESS
    _ends = FAILURE


class RetryUntilSuccessful(_Counted):
    """Tries its child again until it succeeds, or has failed the given number of times."""

    NUM_ATTEMPTS = Port("num_attempts", int, doc="how many times; -1: without end")
    ports = (NUM_ATTEMPTS,)

    _limit = NUM_ATTEMPTS
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
