"""Monitoring of a flight's tree: sends its transitions to a log, to Groot2, or both.

with watched_live(btlog="flight.btlog", groot=1667) as watch:
    app.fly("land_only", listeners=[lambda flight: watch(flight.mission, flight.context)])
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from uav_bt.board.context import MissionContext
from uav_bt.groot.groot_publisher import GrootPublisher
from uav_bt.groot.groot_view import GrootView
from uav_bt.groot.numbering import TreeNumbering, tree_xml
from uav_bt.groot.transitions import BtlogWriter, TransitionRecorder
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.tree import MissionTree


class TreeWatch:
    """Watches one tree, set up but not ticked yet, until `finish`; its log begins here."""

    def __init__(
        self,
        tree: MissionTree,
        context: MissionContext,
        *,
        log: BtlogWriter | None = None,
        publisher: GrootPublisher | None = None,
    ) -> None:
        numbering = TreeNumbering(tree)
        self._clock = context.clock
        self._log = log
        self._view: GrootView | None = None
        self._last_us = self._time_us()
        if log is not None:
            log.begin(tree_xml(numbering), self._last_us)
        if publisher is not None:
            self._view = GrootView(numbering, context.board, self._last_us)
            publisher.show(self._view)
        self._recorder = TransitionRecorder(numbering, context.clock)

    def on_tick(self, _record: TickRecord | None = None) -> None:
        """Send the transitions since the last call; never waits for a client."""
        self._hand_on(self._time_us())

    def finish(self) -> None:
        """Stop watching the tree, and send the transitions of its halt. Safe to call twice."""
        self._recorder.detach()
        self._hand_on(self._last_us)  # the drone with its clock may be disconnected

    def _hand_on(self, now_us: int) -> None:
        transitions = self._recorder.take()
        self._last_us = max([now_us, *(each.time_us for each in transitions[-1:])])
        if self._log is not None:
            self._log.write(transitions)
        if self._view is not None:
            self._view.update(transitions, self._last_us)

    def _time_us(self) -> int:
        return round(self._clock.now() * 1e6)


@contextmanager
def watched_live(
    *, btlog: str | Path | None = None, groot: int | None = None
) -> Iterator[Callable[[MissionTree, MissionContext], Sequence[TickListener]]]:
    """Watch the trees of flights in the context, by the listeners of what it yields.

    Args:
        btlog: the log to write, `*.btlog`.
        groot: port for Groot2 on this machine; the next one is used as well.

    Raises:
        FileError: the log cannot be written (before the flight), or is incomplete (after it).
        InputError: Groot2's ports are taken.
        MissingDependencyError: Groot2 needs the extra `live`.
    """
    with ExitStack() as stack:
        publisher = None if groot is None else stack.enter_context(GrootPublisher(groot))
        log = None if btlog is None else stack.enter_context(BtlogWriter(Path(btlog)))

        def follow(tree: MissionTree, context: MissionContext) -> Sequence[TickListener]:
            if log is None and publisher is None:
                return ()
            watch = TreeWatch(tree, context, log=log, publisher=publisher)
            stack.callback(watch.finish)
            return (watch,)

        yield follow
