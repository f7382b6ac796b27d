"""The log of a tree's events, tick by tick, and assertions on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, TypedDict, Unpack

from uav_bt.errors import UnknownNameError
from uav_bt.protocols import Clock
from uav_bt.tree import MissionTree, Node
from uav_bt.tree.observer import NodeEvent, observe

__tracebackhide__ = True  # pytest shows the test's line of a failed assertion, none of this module

_SHOWN: Final = 200  # the last events in a failure message; chosen
_LEFT_OUT: Final = {NodeEvent.CONTINUES, NodeEvent.HALTING, NodeEvent.STATUS}
_WORDS: Final = [kind.value for kind in NodeEvent if kind not in _LEFT_OUT]


class Counted(TypedDict, total=False):
    """How often and when events are expected: at least once in the whole log, if not given."""

    times: int | None
    tick: int | None


@dataclass(frozen=True, kw_only=True)
class Event:
    """An event of a node."""

    tick: int  # counted from 1; a halt between two ticks has the number of the first
    time_s: float  # of the mission clock
    path: str
    kind: NodeEvent

    def __str__(self) -> str:
        return f"{self.tick:>5}  {self.time_s:>7.2f}  {self.kind.value:<9}  {self.path}"


class EventLog:
    """Records the events of a tree, and checks them.

    A node is named by its path, its name or its node id; a name of several nodes stands for any of
    them. The assertions count events of a node: at least one, or exactly `times`, in the
    whole log or in one `tick`. Every failing assertion shows the whole log.
    """

    def __init__(self, tree: MissionTree, clock: Clock) -> None:
        self.events: list[Event] = []
        self.tick = 0  # number of the present tick, set by the bench
        self._clock = clock
        self._tree = tree
        self._paths: dict[str, set[str]] = {}
        for node in tree.nodes():
            for name in (node.path, node.name, node.node_id):
                self._paths.setdefault(name, set()).add(node.path)
        observe(tree.nodes(), self._note)

    def _note(self, node: Node, kind: NodeEvent) -> None:
        if kind not in _LEFT_OUT:
            now_s = self._clock.now()
            self.events.append(Event(tick=self.tick, time_s=now_s, path=node.path, kind=kind))

    # --- questions --------------------------------------------------------------------------------

    def of(self, node: str, *words: str, tick: int | None = None) -> tuple[Event, ...]:
        """Return the events of a node: of some kinds, such as `halted`, in one tick, or all."""
        if node not in self._paths:
            raise UnknownNameError("node", node, self._paths)
        for word in words:
            if word not in _WORDS:
                raise UnknownNameError("event", word, _WORDS)
        paths, kinds = self._paths[node], words or _WORDS
        found = (each for each in self.events if each.path in paths and each.kind.value in kinds)
        return tuple(event for event in found if tick is None or event.tick == tick)

    def never_ran(self) -> tuple[str, ...]:
        """Return the paths of the nodes that never began, in the order of the tree."""
        began = {event.path for event in self.events if event.kind is NodeEvent.STARTED}
        return tuple(node.path for node in self._tree.nodes() if node.path not in began)

    def table(self) -> str:
        """Return the log as text, a line per event."""
        lines = [" tick     time  event      node"]
        if len(self.events) > _SHOWN:
            lines.append(f"       ... {len(self.events) - _SHOWN} earlier events ...")
        lines += map(str, self.events[-_SHOWN:])
        return "\n".join(lines if self.events else [*lines, "       (nothing happened)"])

    # --- assertions -------------------------------------------------------------------------------

    def assert_started(self, node: str, **counted: Unpack[Counted]) -> None:
        """Fail unless a node began."""
        self._assert(node, "started", **counted)

    def assert_ran(self, node: str, **counted: Unpack[Counted]) -> None:
        """Fail unless a node was ticked."""
        self._assert(node, "started", "ran", **counted)

    def assert_halted(self, node: str, **counted: Unpack[Counted]) -> None:
        """Fail unless a node was stopped while it ran."""
        self._assert(node, "halted", **counted)

    def assert_succeeded(self, node: str, **counted: Unpack[Counted]) -> None:
        """Fail unless a node answered SUCCESS."""
        self._assert(node, "succeeded", **counted)

    def assert_failed(self, node: str, **counted: Unpack[Counted]) -> None:
        """Fail unless a node answered FAILURE."""
        self._assert(node, "failed", **counted)

    def assert_skipped(self, node: str, **counted: Unpack[Counted]) -> None:
        """Fail unless a node answered SKIPPED or was skipped by a condition."""
        self._assert(node, "skipped", **counted)

    def assert_not_started(self, node: str, *, tick: int | None = None) -> None:
        """Fail when a node began."""
        self._assert(node, "started", times=0, tick=tick)

    def assert_not_halted(self, node: str, *, tick: int | None = None) -> None:
        """Fail when a node was stopped while it ran."""
        self._assert(node, "halted", times=0, tick=tick)

    def assert_order(self, *steps: str) -> None:
        """Fail unless these things happened one after another; others may lie between.

            log.assert_order("look_around started", "Avoid started", "look_around halted")

        A step is a node and an event: started, ran, succeeded, failed, skipped, halted or raised.
        """
        words = [step.strip().rpartition(" ") for step in steps]
        wanted = [set(map(id, self.of(node.strip(), word))) for node, _, word in words]
        events = iter(self.events)
        for index, fitting in enumerate(wanted):
            if not any(id(event) in fitting for event in events):
                after = f" after '{steps[index - 1]}'" if index else ""
                raise AssertionError(
                    f"expected in this order: {', '.join(steps)}; "
                    f"'{steps[index]}' did not happen{after}\n{self.table()}"
                )

    def _assert(self, node: str, *words: str, **counted: Unpack[Counted]) -> None:
        times, tick = counted.get("times"), counted.get("tick")
        found = len(self.of(node, *words, tick=tick))
        if (found > 0) if times is None else (found == times):
            return
        when = "" if tick is None else f" in tick {tick}"
        expected = "at least once" if times is None else "never" if times == 0 else f"{times} times"
        raise AssertionError(
            f"expected '{node}' {' or '.join(words)}{when} {expected}, it was {found} times\n"
            f"{self.table()}"
        )
