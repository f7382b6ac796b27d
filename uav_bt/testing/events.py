"""The log of a tree's events, tick by tick, and assertions on it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from uav_bt.errors import UnknownNameError
from uav_bt.protocols import Clock
from uav_bt.tree import MissionTree, Node
from uav_bt.tree.observer import NodeEvent, observe

_SHOWN: Final = 200  # the last events in a failure message; chosen
_LOGGED: Final = (
    NodeEvent.STARTED,
    NodeEvent.RAN,
    NodeEvent.SUCCEEDED,
    NodeEvent.FAILED,
    NodeEvent.SKIPPED,
    NodeEvent.HALTED,
    NodeEvent.RAISED,
)
_WORDS: Final = {kind.value: kind for kind in _LOGGED}
_TICKED: Final = (NodeEvent.STARTED, NodeEvent.RAN)


@dataclass(frozen=True, kw_only=True)
class Event:
    """An event of a node."""

    tick: int  # counted from 1; a halt between two ticks has the number of the first
    time_s: float  # of the mission clock
    path: str
    kind: NodeEvent

    def __str__(self) -> str:
        """Return a line of the table."""
        return f"{self.tick:>5}  {self.time_s:>7.2f}  {self.kind.value:<9}  {self.path}"


class EventLog:
    """Records the events of a tree, and checks them.

    A node is named by its path, its name or its node id; a name of several nodes stands for any of
    them. The assertions count events of a node: at least one, or exactly `times`, in the
    whole log or in one `tick`. Every failing assertion shows the whole log.

    Args:
        tree: the tree to watch.
        clock: the mission's clock.
    """

    def __init__(self, tree: MissionTree, clock: Clock) -> None:
        self.events: list[Event] = []
        self.tick = 0  # number of the present tick, set by the bench
        self._clock = clock
        self._paths: dict[str, set[str]] = {}
        for node in tree.nodes():
            for name in (node.path, node.name, node.node_id):
                self._paths.setdefault(name, set()).add(node.path)
        observe(tree.nodes(), self._note)

    def _note(self, node: Node, kind: NodeEvent) -> None:
        if kind in _LOGGED:
            self.events.append(
                Event(tick=self.tick, time_s=self._clock.now(), path=node.path, kind=kind)
            )

    # --- questions --------------------------------------------------------------------------------

    def of(self, node: str, *kinds: NodeEvent | str, tick: int | None = None) -> tuple[Event, ...]:
        """Return the events of a node.

        Args:
            node: its path, name or node id.
            kinds: the kinds of events; default: all.
            tick: only the events of this tick.

        Raises:
            UnknownNameError: the node or the kind is unknown.
        """
        paths = self._find(node)
        wanted = {_kind(one) for one in kinds} or set(_LOGGED)
        return tuple(
            event
            for event in self.events
            if event.path in paths and event.kind in wanted and (tick is None or event.tick == tick)
        )

    def _find(self, node: str) -> set[str]:
        try:
            return self._paths[node]
        except KeyError:
            raise UnknownNameError("node", node, self._paths) from None

    def table(self) -> str:
        """Return the log as text, a line per event."""
        events = self.events[-_SHOWN:]
        lines = [" tick     time  event      node", *(str(event) for event in events)]
        left_out = len(self.events) - len(events)
        if left_out:
            lines.insert(1, f"       ... {left_out} earlier events ...")
        if not events:
            lines.append("       (nothing happened)")
        return "\n".join(lines)

    # --- assertions -------------------------------------------------------------------------------

    def assert_started(
        self, node: str, *, times: int | None = None, tick: int | None = None
    ) -> None:
        """Fail unless a node began."""
        __tracebackhide__ = True
        self._assert(node, (NodeEvent.STARTED,), times, tick)

    def assert_ran(self, node: str, *, times: int | None = None, tick: int | None = None) -> None:
        """Fail unless a node was ticked."""
        __tracebackhide__ = True
        self._assert(node, _TICKED, times, tick)

    def assert_halted(
        self, node: str, *, times: int | None = None, tick: int | None = None
    ) -> None:
        """Fail unless a node was stopped while it ran."""
        __tracebackhide__ = True
        self._assert(node, (NodeEvent.HALTED,), times, tick)

    def assert_succeeded(
        self, node: str, *, times: int | None = None, tick: int | None = None
    ) -> None:
        """Fail unless a node answered SUCCESS."""
        __tracebackhide__ = True
        self._assert(node, (NodeEvent.SUCCEEDED,), times, tick)

    def assert_failed(
        self, node: str, *, times: int | None = None, tick: int | None = None
    ) -> None:
        """Fail unless a node answered FAILURE."""
        __tracebackhide__ = True
        self._assert(node, (NodeEvent.FAILED,), times, tick)

    def assert_skipped(
        self, node: str, *, times: int | None = None, tick: int | None = None
    ) -> None:
        """Fail unless a node answered SKIPPED or was skipped by a condition."""
        __tracebackhide__ = True
        self._assert(node, (NodeEvent.SKIPPED,), times, tick)

    def assert_not_started(self, node: str, *, tick: int | None = None) -> None:
        """Fail when a node began."""
        __tracebackhide__ = True
        self._assert(node, (NodeEvent.STARTED,), 0, tick)

    def assert_not_halted(self, node: str, *, tick: int | None = None) -> None:
        """Fail when a node was stopped while it ran."""
        __tracebackhide__ = True
        self._assert(node, (NodeEvent.HALTED,), 0, tick)

    def assert_order(self, *steps: str) -> None:
        """Fail unless these things happened one after another; others may lie between.

            log.assert_order("look_around started", "Avoid started", "look_around halted")

        Args:
            steps: a node and an event: started, ran, succeeded, failed, skipped, halted or raised.

        Raises:
            UnknownNameError: the node or the event is unknown.
        """
        __tracebackhide__ = True
        wanted = [self._step(step) for step in steps]
        events = iter(self.events)
        for index, (paths, kind) in enumerate(wanted):
            if not any(e.path in paths and e.kind is kind for e in events):
                after = f" after '{steps[index - 1]}'" if index else ""
                raise AssertionError(
                    f"expected in this order: {', '.join(steps)}; "
                    f"'{steps[index]}' did not happen{after}\n{self.table()}"
                )

    def _step(self, step: str) -> tuple[set[str], NodeEvent]:
        node, _, word = step.strip().rpartition(" ")
        return self._find(node.strip()), _kind(word)

    def _assert(
        self, node: str, kinds: Iterable[NodeEvent], times: int | None, tick: int | None
    ) -> None:
        __tracebackhide__ = True
        kinds = tuple(kinds)
        found = len(self.of(node, *kinds, tick=tick))
        if (found > 0) if times is None else (found == times):
            return
        what = " or ".join(kind.value for kind in kinds)
        when = "" if tick is None else f" in tick {tick}"
        expected = "at least once" if times is None else "never" if times == 0 else f"{times} times"
        raise AssertionError(
            f"expected '{node}' {what}{when} {expected}, it was {found} times\n{self.table()}"
        )


def _kind(word: NodeEvent | str) -> NodeEvent:
    if isinstance(word, NodeEvent):
        return word
    try:
        return _WORDS[word]
    except KeyError:
        raise UnknownNameError("event", word, _WORDS) from None
