"""A flight's tree watched: its transitions go to a log, to Groot2, or both.

with watched_live(btlog=Path("flight.btlog"), groot=GrootConfig()) as watch:
    app.fly("land_only", listeners=[lambda flight: watch(flight.mission, flight.context)])
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from uav_bt.board.context import MissionContext
from uav_bt.groot.btlog import BtlogWriter
from uav_bt.groot.groot_publisher import GrootConfig, GrootPublisher
from uav_bt.groot.groot_view import GrootView
from uav_bt.groot.numbering import TreeNumbering, tree_xml
from uav_bt.groot.transitions import TransitionRecorder
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.tree import MissionTree


class TreeWatch:
    """Watches one tree, from now until `finish`.

    Args:
        tree: set up, not ticked yet.
        context: of its mission.
        log: where transitions are written; it begins here.
        publisher: shows the tree; it is open.

    Raises:
        FileError: the log cannot begin.
        InputError: the tree has more nodes than can be numbered.
    """

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
        self._recorder = TransitionRecorder(numbering, context.clock)
        self._log = log
        self._view: GrootView | None = None
        self._last_us = self._time_us()
        if log is not None:
            log.begin(tree_xml(numbering), self._last_us)
        if publisher is not None:
            self._view = GrootView(numbering, context.board, now_us=self._last_us)
            publisher.show(self._view)
        self._recorder.attach()

    def on_tick(self, record: TickRecord) -> None:
        """Hand on what the runner's tick did."""
        del record  # the transitions have it in more detail
        self.after_tick()

    def after_tick(self) -> None:
        """Hand on what happened since the last call; never waits for a client."""
        self._hand_on(self._time_us())

    def finish(self) -> None:
        """Leave the tree as it was, and hand on how it was halted. Safe to call twice."""
        self._recorder.detach()
        self._hand_on(self._last_us)  # the drone, whose clock it is, may be gone by now

    def _hand_on(self, now_us: int) -> None:
        transitions = self._recorder.take()
        if transitions:
            now_us = max(now_us, transitions[-1].time_us)
        self._last_us = now_us
        if self._log is not None:
            self._log.write(transitions)
        if self._view is not None:
            self._view.update(transitions, now_us)

    def _time_us(self) -> int:
        return round(self._clock.now() * 1e6)


class LiveListeners:
    """Makes what follows a tree that is about to fly.

    Args:
        log: where transitions are written.
        publisher: shows the tree; it is open.
    """

    def __init__(self, log: BtlogWriter | None, publisher: GrootPublisher | None) -> None:
        self._log = log
        self.publisher = publisher  # its port is known from now on
        self._watches: list[TreeWatch] = []

    def __call__(self, tree: MissionTree, context: MissionContext) -> Sequence[TickListener]:
        """Begin to watch a tree that is about to fly."""
        if self._log is None and self.publisher is None:
            return []
        watch = TreeWatch(tree, context, log=self._log, publisher=self.publisher)
        self._watches.append(watch)
        return [watch]

    def finish(self) -> None:
        """Watch no longer."""
        for watch in self._watches:
            watch.finish()


@contextmanager
def watched_live(
    *, btlog: str | Path | None = None, groot: GrootConfig | None = None
) -> Iterator[LiveListeners]:
    """Watch the tree of the flight that is flown inside.

    Args:
        btlog: the log to write, `*.btlog`.
        groot: where Groot2 can connect while the flight goes on.

    Raises:
        FileError: the log cannot be written (before anything flies), or was not whole (after).
        InputError: Groot2's ports are taken.
        MissingDependencyError: Groot2 needs the extra `live`.
    """
    with ExitStack() as stack:
        publisher = None if groot is None else stack.enter_context(GrootPublisher(groot))
        log = None if btlog is None else stack.enter_context(BtlogWriter(Path(btlog)))
        listeners = LiveListeners(log, publisher)
        stack.callback(listeners.finish)
        yield listeners
