"""Differences between a replay and its recording."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass, field
from typing import Any, Final

from uav_bt.app.replay.recorded_drone import RecordedDrone
from uav_bt.display.phrases import describe_movement
from uav_bt.mission.tick import TickRecord
from uav_bt.record.channels import TreeNote
from uav_bt.tree import MissionTree
from uav_bt.types import Command, GimbalTo, MoveBy, Movement

# A lossy record replays as the recorded flight when commands agree to this (metres, radians, or
# those a second), and all but this share of the ticks agree in statuses and commands.
LOSSY_NUMBERS: Final = 0.05
LOSSY_TICKS: Final = 0.05
_KEPT: Final = 1_000  # differing ticks that are kept one by one


@dataclass(frozen=True)
class Difference:
    """A tick in which replay and recording differ; each pair is recorded, replayed."""

    tick: int
    time_s: float
    statuses: dict[str, tuple[str, str]] = field(default_factory=dict)  # by the node's path
    command: tuple[str, str] | None = None
    proposed_by: tuple[str | None, str | None] | None = None


@dataclass(kw_only=True)
class ReplayReport:
    """Result of a replay."""

    record: str
    tree: str
    outcome: str | None  # of the recorded flight; None when its record is unfinished
    exact: bool = True  # the recorded images are lossless and whole
    masks: str  # "network" or "recorded"
    ticks: int = 0
    status_ticks: int = 0  # in which a node's status differs
    command_ticks: int = 0  # in which the command or who proposed it differs
    differing_ticks: int = 0  # either
    differences: list[Difference] = field(default_factory=list)  # the first of them
    nodes: dict[str, int] = field(default_factory=dict)  # differing ticks by path, most first
    only_recorded: tuple[str, ...] = ()  # nodes that the replayed tree does not have
    only_replayed: tuple[str, ...] = ()
    missing_images: int = 0
    damages: tuple[str, ...] = ()
    ended: str | None = None  # why the replay stopped before the recording's end

    @property
    def same(self) -> bool:
        """Whether the replay is the recorded flight, within the tolerance."""
        if self.only_recorded or self.only_replayed or self.ended is not None:
            return False
        allowed = 0 if self.exact else int(LOSSY_TICKS * self.ticks)
        return self.differing_ticks <= allowed

    def to_json(self) -> dict[str, Any]:
        """Return the report as plain JSON values."""
        return {**asdict(self), "same": self.same}


class Comparison:
    """Compares a replay with its record, tick by tick, into a report."""

    def __init__(
        self, report: ReplayReport, recorded: TreeNote, tree: MissionTree, drone: RecordedDrone
    ) -> None:
        there = {node.path: place for place, node in enumerate(recorded.nodes)}
        here = {node.path: node for node in tree.nodes()}
        self._shared = [(path, there[path], here[path]) for path in there if path in here]
        report.only_recorded = tuple(path for path in there if path not in here)
        report.only_replayed = tuple(path for path in here if path not in there)
        self._report = report
        self._drone = drone
        self._tolerance = 0.0 if report.exact else LOSSY_NUMBERS
        self._nodes: Counter[str] = Counter()

    def on_tick(self, record: TickRecord) -> None:
        """Compare a tick with the recorded one."""
        report, moment = self._report, self._drone.moment
        statuses = {
            path: (moment.statuses[place], node.node_status.name)
            for path, place, node in self._shared
            if place < len(moment.statuses) and moment.statuses[place] != node.node_status.name
        }
        command = self._command(moment.commands.decided, record.decided or record.command)
        pair = (moment.commands.proposed_by, record.proposed_by)
        owners = pair if pair[0] != pair[1] else None
        differs = bool(statuses or command or owners)
        self._nodes.update(statuses.keys())
        report.nodes = dict(self._nodes.most_common())
        report.ticks += 1
        report.status_ticks += bool(statuses)
        report.command_ticks += bool(command or owners)
        report.differing_ticks += differs
        if differs and len(report.differences) < _KEPT:
            at = moment.tick
            report.differences.append(Difference(at.index, at.time_s, statuses, command, owners))

    def _command(self, recorded: Command, replayed: Command) -> tuple[str, str] | None:
        same_id = self._drone.ids.pair(recorded.movement, replayed.movement)
        movements = self._agree(recorded.movement, replayed.movement)
        if same_id and movements and self._agree(recorded.gimbal, replayed.gimbal):
            return None
        return _words(recorded), _words(replayed)

    def _agree(self, one: Movement | GimbalTo | None, other: Movement | GimbalTo | None) -> bool:
        if type(one) is not type(other) or one is None:
            return one is other
        return all(
            abs(value - getattr(other, name)) <= self._tolerance
            for name, value in vars(one).items()
            if name != "id"  # pairs of movements are compared by it
        )


def _words(command: Command) -> str:
    movement, gimbal = command.movement, command.gimbal
    number = f" (#{movement.id})" if isinstance(movement, MoveBy) else ""
    tilt = "" if gimbal is None else f", gimbal {gimbal.pitch_rad:.3f} rad"
    return f"{describe_movement(movement)}{number}{tilt}"
