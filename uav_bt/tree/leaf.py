"""Leaves: where a tree meets the world. What an author of behaviours subclasses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Self, TypeVar

from uav_bt.board.blackboard import BoardView, Key, Reading
from uav_bt.board.context import MissionContext
from uav_bt.errors import MissionError, NodeFailedError
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.observer import NodeEvent, Observer
from uav_bt.tree.port import check_declared
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Status
from uav_bt.types import GimbalTo, Movement

T = TypeVar("T")


class Leaf(Node):
    """An action or a condition.

    When what runs: `on_setup` once, before the first tick; `initialise` when an activation begins;
    `update` every tick, returning at once; `terminate` exactly once per activation, with SUCCESS or
    FAILURE when it ended by itself and with IDLE when it was halted; `on_shutdown` once, after the
    last tick. `terminate` commands
    nothing: a tree starts its new branch before it stops the old one. In flight, a leaf that takes
    longer than `budget_s` is reported by name.

    The first line of the class's docstring is its description in `uav-bt tree nodes`.
    """

    reads: ClassVar[tuple[Key[Any], ...]] = ()  # board keys this leaf reads
    writes: ClassVar[tuple[Key[Any], ...]] = ()  # board keys this leaf writes
    moves: ClassVar[bool] = False  # True: it proposes a movement in every tick until it ends
    points: ClassVar[bool] = False  # True: likewise a camera direction
    condition: ClassVar[bool] = False  # True: answers at once, never RUNNING
    # Wall time that one tick of it may take: some ticks, for a machine that is busy for a moment.
    budget_s: ClassVar[float] = 0.5
    kind = NodeKind.ACTION

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        for name in ("reads", "writes"):
            check_declared(cls, name, Key)
        cls.kind = NodeKind.CONDITION if cls.condition else NodeKind.ACTION

    def __init__(self, name: str | None = None, /, **given: object) -> None:
        super().__init__(name, **given)
        self._view: BoardView | None = None
        self._is_open = False  # set up, and not shut down

    @classmethod
    def values_taken(cls, by_key: Mapping[Key[Any], Mapping[str, str]]) -> dict[str, str]:
        """Return the attributes that this leaf takes, of those given for writers of board keys.

        Args:
            by_key: values by attribute, by the board key that a leaf writes.
        """
        ports = {port.name for port in cls.ports}
        given = (by_key.get(key, {}) for key in cls.writes)
        return {name: text for each in given for name, text in each.items() if name in ports}

    # --- for authors to override ------------------------------------------------------------------

    def on_setup(self, mission: MissionContext) -> None:
        """Load what lasts the whole mission; raise when it is missing."""

    def on_shutdown(self) -> None:
        """Close what `on_setup` opened: a device, a file, a thread.

        Called once when the flight is over, or when another tree has replaced the leaf's in flight;
        not for a leaf whose `on_setup` raised.
        """

    def on_inherit(self, former: Self) -> None:
        """Take over the knowledge of a leaf of this class whose tree this one replaces in flight.

        Called once, after `on_setup`. Leave out values that the new leaf's ports make useless.
        """

    def initialise(self) -> None:
        """Begin an activation."""

    def terminate(self, new_status: Status) -> None:
        """Release the activation's resources; the class says when, and with which status."""

    # --- for authors to call ----------------------------------------------------------------------

    def read(self, key: Key[T]) -> Reading[T]:
        """Read the board; a stale value reads as none, with its age.

        Raises:
            BoardAccessError: the key is not among `reads`.
        """
        return self._board.read(key)

    def write(self, key: Key[T], value: T, captured_s: float | None = None) -> None:
        """Write the board; `captured_s` is the capture time of the data behind the value.

        Args:
            key: one of `writes`, or what an output port is connected to.
            value: in the unit of the key.
            captured_s: capture time of the data behind the value; default: now.

        Raises:
            BoardAccessError: the key is not among `writes`, or the value has another type.
        """
        self._board.write(key, value, captured_s)

    def forget(self, key: Key[Any]) -> None:
        """Drop a value of the board."""
        self._board.forget(key)

    def propose(self, movement: Movement) -> None:
        """Ask for a movement in this tick; ask again every tick for as long as it is wanted.

        Raises:
            ProposalConflictError: another leaf asked already.
        """
        self.mission.proposals.propose(self.path, movement)

    def point(self, gimbal: GimbalTo) -> None:
        """Ask for a camera direction in this tick."""
        self.mission.proposals.propose_gimbal(self.path, gimbal)

    def inherit(self, former: Self) -> None:
        """Call `on_inherit`; `MissionTree` does.

        Raises:
            NodeFailedError: it raised.
        """
        try:
            self.on_inherit(former)
        except Exception as error:
            raise NodeFailedError(self.path, error, self.author) from error

    def shutdown(self) -> None:
        """Call `on_shutdown` of a leaf that is set up; `MissionTree` and py_trees' trees do.

        Raises:
            NodeFailedError: it raised.
        """
        if not self._is_open:
            return
        self._is_open = False
        try:
            self.on_shutdown()
        except Exception as error:
            raise NodeFailedError(self.path, error, self.author) from error

    # --- the engine's side ------------------------------------------------------------------------

    @property
    def _board(self) -> BoardView:
        if self._view is None:
            raise MissionError(f"leaf '{self.path}' is not set up: call MissionTree.setup first")
        return self._view

    def _setup(self) -> None:
        mission = self.mission
        for key in (*self.reads, *self.writes):
            mission.board.declare(key)
        # The tree file declares what it connects to a port.
        reads, writes = [*self.reads], [*self.writes]
        for port in self.ports:
            reference = self._references.get(port.name)
            if reference is not None and reference.on_board:
                key = mission.board.key(reference.key)
                if port.direction != "output":
                    reads.append(key)
                if port.direction != "input":
                    writes.append(key)
        self._view = BoardView(mission.board, self.path, reads=reads, writes=writes)
        self.on_setup(mission)
        self._is_open = True

    def _notify_work(self, observer: Observer) -> None:
        if self.condition or self.node_status in (IDLE, RUNNING):  # else it is not ticked again
            super()._notify_work(observer)

    def _tick(self) -> Status:
        standing = self.node_status
        if standing is RUNNING:
            status = self.update()
        elif standing is IDLE or self.condition:
            try:
                self.initialise()
                status = self.update()
            except BaseException:
                self.set_status(RUNNING)  # it has begun, so halting the tree must end it
                raise
        else:
            return standing  # done and not reset: the engine does not tick it again
        if status is RUNNING and not self.condition:
            return status
        if status is SKIPPED:
            if standing is not RUNNING:
                self._end(IDLE)
            return status
        if status is not SUCCESS and status is not FAILURE:
            self.set_status(RUNNING)
            raise MissionError(self._wrong_answer(status))
        try:  # `_end`, without a call
            self.terminate(status)
        finally:
            self.node_status = status
            if self.observer is not None:
                self.observer(self, NodeEvent.STATUS)
        return status

    def _wrong_answer(self, status: object) -> str:
        allowed = "SUCCESS or FAILURE" if self.condition else "SUCCESS, FAILURE or RUNNING"
        return f"update() of {type(self).__qualname__} must return {allowed}, got {status!r}"

    def _end(self, new_status: Status) -> None:
        try:
            self.terminate(new_status)
        finally:
            self.set_status(new_status)

    def _halt(self) -> None:
        if self.node_status is RUNNING:
            self._end(IDLE)
        self.set_status(IDLE)
