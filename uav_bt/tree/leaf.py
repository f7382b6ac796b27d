"""The base class of leaves, which authors of behaviours subclass."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Self, TypeVar

from uav_bt.board.blackboard import BoardView, Key, Reading
from uav_bt.board.context import MissionContext
from uav_bt.board.keys import PHASE
from uav_bt.errors import MissionError, UnknownValueError
from uav_bt.lab.lab import Lab
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.observer import NodeEvent
from uav_bt.tree.port import check_declared
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Status
from uav_bt.tree.variables import After, Follow, Known
from uav_bt.types import GimbalTo, Movement
from uav_bt.types.place import MissionRules

T = TypeVar("T")


class Leaf(Node):
    """An action or a condition.

    Life cycle: `on_setup` runs once, before the first tick. `initialise` runs when an activation
    begins. `update` runs at every tick and must return at once. `terminate` runs exactly once per
    activation, with SUCCESS or FAILURE when the leaf ended by itself and with IDLE when it was
    halted. `on_shutdown` runs once, after the last tick. `terminate` must not command a movement,
    since a tree starts its new branch before it stops the old one. In flight, a leaf that takes
    longer than `budget_s` is reported by name.

    The first line of the class's docstring is its description in `uav-bt tree nodes`.
    """

    reads: ClassVar[tuple[Key[Any], ...]] = ()  # board keys this leaf reads
    writes: ClassVar[tuple[Key[Any], ...]] = ()  # board keys this leaf writes
    needed: ClassVar[tuple[Key[Any], ...]] = ()  # those of `reads` without which it cannot succeed
    # What `update` may return. SKIPPED is among them only where a leaf names it.
    answers: ClassVar[tuple[Status, ...]] = (SUCCESS, FAILURE, RUNNING)
    moves: ClassVar[bool] = False  # True: it may propose a movement while it is RUNNING
    points: ClassVar[bool] = False  # True: likewise a camera direction
    takes_off: ClassVar[bool] = False  # True: the flight begins with it
    lands: ClassVar[bool] = False  # True: it ends with the drone on the ground
    repeats: ClassVar[bool] = False  # True: ticked after SUCCESS, it does its work once more
    condition: ClassVar[bool] = False  # True: answers at once, never RUNNING
    group: ClassVar[str] = ""  # heading on the page of nodes; empty: by what the leaf declares
    # Wall time that one tick of this leaf may take. Several ticks long, as a machine may be busy.
    budget_s: ClassVar[float] = 0.5
    kind = NodeKind.ACTION

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        for name in ("reads", "writes", "needed"):
            check_declared(cls, name, Key)
        check_declared(cls, "answers", Status)
        if cls.condition:
            cls.answers = tuple(answer for answer in cls.answers if answer is not RUNNING)
        cls.kind = NodeKind.CONDITION if cls.condition else NodeKind.ACTION

    def __init__(self, name: str | None = None, /, **given: object) -> None:
        super().__init__(name, **given)
        self._view: BoardView | None = None
        self._is_open = False  # set up and not yet shut down

    @classmethod
    def values_taken(cls, by_key: Mapping[Key[Any], Mapping[str, str]]) -> dict[str, str]:
        """Select the attributes that this leaf accepts from those for writers of board keys."""
        ports = {port.name for port in cls.ports}
        given = (by_key.get(key, {}) for key in cls.writes)
        return {name: text for each in given for name, text in each.items() if name in ports}

    def variables_after(self, _: Follow, known: Known) -> After:
        """Return the variables with a value after each of the `answers`, outputs left out."""
        ends = (SUCCESS, FAILURE, SKIPPED)
        return After(*(known if one in self.answers else None for one in ends))

    def may_point(self) -> bool:
        """Return whether the leaf may propose a camera direction with the values of its ports."""
        return self.points

    # --- for authors to override ------------------------------------------------------------------

    def needs(self) -> tuple[Key[Any], ...]:
        """Return the keys without which the leaf cannot succeed with the values of its ports."""
        return self.needed

    def refuses(self, rules: MissionRules) -> str | None:
        """Return why the leaf cannot keep the mission's rules with the values that its file has."""

    def refuses_lab(self, lab: Callable[[], Lab]) -> str | None:
        """Return why the leaf cannot fly in a lab, which takes time to read, with its values."""

    def on_setup(self, mission: MissionContext) -> None:
        """Load the resources of the whole mission; raise when one is missing."""

    def on_shutdown(self) -> None:
        """Close what `on_setup` opened: a device, a file, a thread.

        Called once when the flight is over or another tree has replaced this leaf's tree in flight.
        Not called for a leaf whose `on_setup` raised.
        """

    def on_inherit(self, former: Self) -> None:
        """Copy the state of a leaf of this class whose tree is replaced in flight by this leaf's.

        Called once, after `on_setup`. Do not copy values that no longer fit this leaf's ports.
        """

    def initialise(self) -> None:
        """Begin an activation."""

    def terminate(self, new_status: Status) -> None:
        """Release the activation's resources; the class documents when this is called."""

    # --- for authors to call ----------------------------------------------------------------------

    def read(self, key: Key[T]) -> Reading[T]:
        """Read a key of the board; a stale value reads as None, with its age.

        Raises:
            BoardAccessError: the key is not among `reads`.
        """
        return self._board.read(key)

    def write(self, key: Key[T], value: T, captured_s: float | None = None) -> None:
        """Write the board; `captured_s` is the capture time of the data behind the value.

        Args:
            key: one of `writes`, or the key that an output port is connected to.
            value: the value, in the unit of the key.
            captured_s: capture time of the data behind the value; default: now.

        Raises:
            BoardAccessError: the key is not among `writes`, or the value has another type.
        """
        self._board.write(key, value, captured_s)

    def forget(self, key: Key[Any]) -> None:
        """Delete a value from the board."""
        self._board.forget(key)

    def propose(self, movement: Movement) -> None:
        """Propose a movement for this tick; repeat it every tick while the movement is wanted.

        In the tick in which the leaf ends, the proposal of a later leaf replaces it. The name of a
        leaf that does not declare `PHASE` among its `writes` becomes the mission's phase.

        Raises:
            ProposalConflictError: a leaf that runs on has proposed a movement in this tick.
        """
        self.mission.proposals.propose(self.path, movement)
        if PHASE not in self.writes:
            self.mission.board.write(PHASE, self.name)

    def point(self, gimbal: GimbalTo) -> None:
        """Propose a camera direction for this tick."""
        self.mission.proposals.propose_gimbal(self.path, gimbal)

    # --- the engine's side ------------------------------------------------------------------------

    @property
    def _board(self) -> BoardView:
        if self._view is None:
            raise MissionError(f"leaf '{self.path}' is not set up: call MissionTree.setup first")
        return self._view

    def _setup(self) -> None:
        mission = self.mission
        for key in (*self.reads, *self.writes, PHASE):
            mission.board.declare(key)
        # A board key connected to a port counts as declared.
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

    def shutdown(self) -> None:
        """Call `on_shutdown` if the leaf is set up; used by `MissionTree` and trees of py_trees."""
        if self._is_open:
            self._is_open = False
            with self.failing():
                self.on_shutdown()

    def _notify_work(self) -> None:
        if self.condition or self.node_status in (IDLE, RUNNING):  # else not ticked again
            super()._notify_work()

    def _tick(self) -> Status:
        standing = self.node_status
        if standing is RUNNING:
            status = self.update()
        elif standing is IDLE or self.condition:
            try:
                self.initialise()
                status = self.update()
            except BaseException:
                self.set_status(RUNNING)  # the activation began, so a halt must terminate it
                raise
        else:
            return standing  # finished and not reset: the engine does not tick it again
        if status not in self.answers:
            self.set_status(RUNNING)
            *most, last = (answer.name for answer in self.answers)
            allowed = f"{', '.join(most)} or {last}" if most else last
            hint = ": name it in `answers`" if isinstance(status, Status) else ""
            what = f"update() of {type(self).__qualname__} must return {allowed}"
            raise MissionError(f"{what}, got {status!r}{hint}")
        if status is RUNNING:
            return status
        self.mission.proposals.end(self.path)
        if status is SKIPPED:
            if standing is not RUNNING:
                self._end(IDLE)
            return status
        try:  # as `_end`, without the cost of a call
            self.terminate(status)
        finally:
            self.node_status = status
            if self.observers:
                self._notify(NodeEvent.STATUS)
        return status

    def _fail(self, unknown: UnknownValueError) -> Status:
        """End the activation, if one began, and take back this tick's proposals."""
        self._tell(unknown)
        self.mission.proposals.withdraw(self.path)
        if self.node_status is RUNNING:
            self._end(FAILURE)
        return FAILURE

    def _end(self, new_status: Status) -> None:
        try:
            self.terminate(new_status)
        finally:
            self.set_status(new_status)

    def _halt(self) -> None:
        if self.node_status is RUNNING:
            self.mission.proposals.withdraw(self.path)  # the next leaf may move in this tick
            self._end(IDLE)
        self.set_status(IDLE)
