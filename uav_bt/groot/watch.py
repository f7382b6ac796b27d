"""Monitoring of a flight's tree: sends its transitions to a log, to Groot2, or both.

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
    """Watches one tree from its creation until `finish`.

    Args:
        tree: the tree, set up but not ticked yet.
        context: context of the mission.
        log: log for the transitions, which begins here; or None.
        publisher: open publisher that shows the tree; or None.

    Raises:
        FileError: the log cannot be opened.
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
        """Send the transitions of the runner's tick."""
        del record  # the transitions contain more detail
        self.after_tick()

    def after_tick(self) -> None:
        """Send the transitions since the last call; never waits for a client."""
        self._hand_on(self._time_us())

    def finish(self) -> None:
        """Stop watching the tree, and send the transitions of its halt. Safe to call twice."""
        self._recorder.detach()
        self._hand_on(self._last_us)  # the drone with its clock may be disconnected

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
    """Makes the listeners of a tree before its flight.

    Args:
        log: log for the transitions; or None.
        publisher: open publisher that shows the tree; or None.
    """

    def __init__(self, log: BtlogWriter | None, publisher: GrootPublisher | None) -> None:
        self._log = log
        self.publisher = publisher  # open, so that its port is known
        self._watches: list[TreeWatch] = []

    def __call__(self, tree: MissionTree, context: MissionContext) -> Sequence[TickListener]:
        """Start watching a tree before its flight."""
        if self._log is None and self.publisher is None:
            return []
        watch = TreeWatch(tree, context, log=self._log, publisher=self.publisher)
        self._watches.append(watch)
        return [watch]

    def finish(self) -> None:
        """Stop watching."""
        for watch in self._watches:
            watch.finish()


@contextmanager
def watched_live(
    *, btlog: str | Path | None = None, groot: GrootConfig | None = None
) -> Iterator[LiveListeners]:
    """Watch the tree of the flight in the context.

    Args:
        btlog: the log to write, `*.btlog`.
        groot: address for Groot2 during the flight.

    Raises:
        FileError: the log cannot be written (before the flight), or is incomplete (after it).
        InputError: Groot2's ports are taken.
        MissingDependencyError: Groot2 needs the extra `live`.
    """
    with ExitStack() as stack:
        publisher = None if groot is None else stack.enter_context(GrootPublisher(groot))
        log = None if btlog is None else stack.enter_context(BtlogWriter(Path(btlog)))
        listeners = LiveListeners(log, publisher)
        stack.callback(listeners.finish)
        yield listeners
