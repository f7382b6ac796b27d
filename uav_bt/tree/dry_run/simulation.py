"""Dry runs: a mission's tree ticked with leaves that answer by a script.

The tree is the real one, with its control nodes, decorators, conditions, scripts and timers; only
the leaves that would fly are replaced. The format's own leaves (`Script`, `Sleep`, ...) do what
they always do, unless the script has answers for them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from uav_bt.board import ELAPSED, MISSION_KEYS
from uav_bt.board.blackboard import Blackboard, Key
from uav_bt.board.context import MissionContext
from uav_bt.board.numbers import QUIET
from uav_bt.clock import ManualClock
from uav_bt.errors import BoardAccessError, FileError, NodeFailedError, ValueRangeError
from uav_bt.tree import MissionTree, Node, NodeRegistry, Status
from uav_bt.tree.dry_run.script_file import SimulationScript, scripted_tree
from uav_bt.tree.loading.lookup import Lookup
from uav_bt.tree.loading.parameters import Parameters
from uav_bt.tree.nodes.base import SubTree
from uav_bt.tree.observer import NodeEvent, observe
from uav_bt.tree.status import RUNNING

_PLAIN: Final = (bool, int, float, str)
_ANSWERS: Final = {
    NodeEvent.CONTINUES: Status.RUNNING,
    NodeEvent.SUCCEEDED: Status.SUCCESS,
    NodeEvent.FAILED: Status.FAILURE,
    NodeEvent.SKIPPED: Status.SKIPPED,
}


@dataclass(frozen=True)
class Answer:
    """The answer of a leaf."""

    leaf: str
    status: Status


@dataclass(frozen=True, kw_only=True)
class SimulatedTick:
    """What happened in a tick."""

    tick: int  # counted from 1
    time_s: float  # of the mission clock
    status: Status  # of the root
    answers: tuple[Answer, ...]  # in the order in which the leaves answered
    halted: tuple[str, ...]  # leaves that were stopped while they ran
    changed: Mapping[str, Any]  # variables (those of subtrees as `subtree.name`) and `@board_key`s


class _ForeignBoard(Blackboard):
    """The board of trees that were written elsewhere: any key is there, and holds anything."""

    def key(self, name: str) -> Key[Any]:
        """Return a key by name."""
        if name not in self.keys:
            self.declare(Key(name, object, "of a board that is not ours"))
        return super().key(name)

    def scripts_may_write(self, name: str) -> bool:
        """Return whether a key is of the other engine's board, where scripts may write."""
        return self.key(name).type is object


class Simulation:
    """A mission file with scripted leaves, ready to be ticked.

    Args:
        tree: the file.
        script: what its leaves answer.
        registry: the nodes that may occur; default: all installed.
        tick_s: time between two ticks.
        tree_id: which of the file's trees; see `load_tree`.
        lookup: where to look for trees and included files; see `load_tree`.
        parameters: values from outside; they take precedence over the script's variables.

    Raises:
        TreeError: the tree was refused, or a leaf has no script.
        FileError: the script does not fit the tree.
        ValueRangeError: the time between two ticks is not positive.
    """

    def __init__(
        self,
        tree: Path,
        script: SimulationScript,
        registry: NodeRegistry | None = None,
        *,
        tick_s: float = 0.1,
        tree_id: str | None = None,
        lookup: Lookup | None = None,
        parameters: Parameters | None = None,
    ) -> None:
        if not tick_s > 0.0:
            raise ValueRangeError(f"ticks come one after another, got {tick_s} s between them")
        self.tree: Final = scripted_tree(
            tree, script, registry, tree_id=tree_id, lookup=lookup, parameters=parameters
        )
        self._script = script
        self._tick_s = tick_s
        self._clock = ManualClock()
        foreign = registry is not None and registry.foreign_board
        board = _ForeignBoard if foreign else Blackboard
        self._board = board(self._clock, MISSION_KEYS)
        self._names = _short_names(self.tree)
        self._answers: list[Answer] = []
        self._halted: list[str] = []
        self._given: dict[str, Any] = {}  # values that the script wrote to the board
        self.tree.setup(MissionContext(board=self._board, clock=self._clock))
        self._write_board()
        observe(self.tree.leaves(), self._note)

    def run(self, max_ticks: int) -> Iterator[SimulatedTick]:
        """Tick until the root ends or the limit of ticks is reached, and yield each tick.

        Raises:
            NodeFailedError: a node raised: a script that fails, a node known from a palette only.
        """
        before = self._values()
        for tick in range(1, max_ticks + 1):
            if tick > 1:
                self._clock.sleep_until((tick - 1) * self._tick_s)
            self._write_board()
            self._answers.clear()
            self._halted.clear()
            try:
                status = self.tree.tick()
            except NodeFailedError as error:
                self._name_unset(error)
                raise
            now = self._values()
            yield SimulatedTick(
                tick=tick,
                time_s=self._clock.now(),
                status=status,
                answers=tuple(self._answers),
                halted=tuple(self._halted),
                changed=_changes(before, now),
            )
            before = now
            if status is not RUNNING:
                return

    # --- what leaves do ---------------------------------------------------------------------------

    def _note(self, node: Node, event: NodeEvent) -> None:
        name = self._names[node.path]
        if event is NodeEvent.HALTED:
            self._halted.append(name)
        elif event in _ANSWERS:
            self._answers.append(Answer(name, _ANSWERS[event]))

    def _name_unset(self, error: NodeFailedError) -> None:
        """Add all variables that the script has yet to give, as the first may not be the last."""
        unset = [name for name in self.tree.unset if name not in self._script.variables]
        if unset:
            values = ", ".join(f"{name}: 0" for name in unset)
            error.add_note(
                f"nothing in the tree file sets {', '.join(unset)}: give them values in "
                f"{self._script.path}, as in variables: {{{values}}}"
            )
        written = self._board.snapshot()
        theirs = [name for name, key in self._board.keys.items() if key.type is object]
        if empty := [name for name in theirs if name not in written]:
            values = ", ".join(f"{name}: 0" for name in empty)
            error.add_note(
                f"the board is not ours, and nothing has set {', '.join(empty)}: give them values "
                f"in {self._script.path}, as in board: {{{values}}}"
            )

    # --- values -----------------------------------------------------------------------------------

    def _write_board(self) -> None:
        self._board.write(ELAPSED, self._clock.now())
        written = self._board.snapshot()
        for number, value in QUIET:
            if number.name not in written:
                self._board.write(number, value)
        for name, scalar in self._script.board.items():
            # A value that a leaf wrote over it stays.
            if name in self._given and written[name][0] is not self._given[name]:
                continue
            self._given[name] = scalar.value
            try:
                self._board.write(self._board.key(name), scalar.value)
            except BoardAccessError as error:
                raise FileError(self._script.path, str(error), scalar.line) from error

    def _values(self) -> dict[str, Any]:
        values = self.tree.variables.snapshot()
        for node in self.tree.nodes():
            if isinstance(node, SubTree):
                inner = node.child.variables.snapshot()
                values |= {f"{node.name}.{name}": value for name, value in inner.items()}
        board = self._board.snapshot()
        del board[ELAPSED.name]  # it changes every tick
        return values | {f"@{name}": value for name, (value, _) in board.items()}


def _short_names(tree: MissionTree) -> dict[str, str]:
    count = Counter(leaf.name for leaf in tree.leaves())
    return {leaf.path: leaf.name if count[leaf.name] == 1 else leaf.path for leaf in tree.leaves()}


def _changes(before: Mapping[str, Any], now: Mapping[str, Any]) -> dict[str, Any]:
    changed = {
        name: value
        for name, value in now.items()
        if name not in before or _differs(before[name], value)
    }
    return changed | {name: None for name in before if name not in now}


def _differs(before: Any, now: Any) -> bool:
    if before is now:
        return False
    # Only plain values are compared: equality of others may not be defined.
    return type(before) is not type(now) or not isinstance(now, _PLAIN) or before != now
