"""How often each node ran, how long, and how it ended: what a log tells about nodes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from uav_bt.groot.transitions import NodeStatus, Transition

__all__ = ["NodeDurations", "node_durations"]


@dataclass(kw_only=True)
class NodeDurations:
    """One node over a whole log. Times are microseconds of the mission clock."""

    uid: int
    activations: int = 0  # from idle to a status, or from a result straight into the next run
    running_us: int = 0  # in all
    longest_us: int = 0  # of one activation
    successes: int = 0
    failures: int = 0
    halts: int = 0  # while running
    still_running: bool = False  # when the log ended; counted up to there


class _Watch:
    """One node while the log is read."""

    def __init__(self, uid: int) -> None:
        self.durations = NodeDurations(uid=uid)
        self._status = NodeStatus.IDLE
        self._since_us = 0

    def turn(self, status: NodeStatus, time_us: int) -> None:
        was, self._status = self._status, status
        durations = self.durations
        if was is NodeStatus.RUNNING:
            self._ran_until(time_us)
            durations.halts += status is NodeStatus.IDLE
        elif status not in {NodeStatus.IDLE, NodeStatus.SKIPPED}:
            durations.activations += 1
        if status is NodeStatus.RUNNING:
            self._since_us = time_us
        durations.successes += status is NodeStatus.SUCCESS
        durations.failures += status is NodeStatus.FAILURE

    def finish(self, time_us: int) -> None:
        if self._status is NodeStatus.RUNNING:
            self._ran_until(time_us)
            self.durations.still_running = True

    def _ran_until(self, time_us: int) -> None:
        ran_us = time_us - self._since_us
        self.durations.running_us += ran_us
        self.durations.longest_us = max(self.durations.longest_us, ran_us)


def node_durations(transitions: Iterable[Transition]) -> dict[int, NodeDurations]:
    """Return the durations of all nodes that occur, by uid, in the order of their first activity.

    Args:
        transitions: in the order of their times.
    """
    watches: dict[int, _Watch] = {}
    time_us = 0
    for time_us, uid, status in transitions:
        watches.setdefault(uid, _Watch(uid)).turn(status, time_us)
    for watch in watches.values():
        watch.finish(time_us)
    return {uid: watch.durations for uid, watch in watches.items()}
