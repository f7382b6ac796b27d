"""What all nodes share: ports, place in the tree, and the tick.

A node is ticked through `execute_tick`, plain calls that follow BehaviorTree.CPP 4.10 step by step.
py_trees has another model of a tick (generators, four statuses, a composite per policy), so none of
its engine is used. A node is a `py_trees.behaviour.Behaviour` for the sake of py_trees' tools: from
there it has its id, children, parent, feedback message and `iterate`, and it answers `setup`,
`tick`, `stop` and `status` as py_trees' trees, visitors and renderers expect. `status` is py_trees'
status; `node_status` is ours.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, ClassVar, Final, TypeVar

from py_trees import common

from uav_bt.board.blackboard import Key, Reading
from uav_bt.board.context import MissionContext
from uav_bt.errors import BoardAccessError, InputError, MissionError, NodeFailedError
from uav_bt.protocols import Clock
from uav_bt.tree.conditions import CONDITION_ATTRIBUTES, Conditions, check_condition
from uav_bt.tree.observer import NodeEvent, Observer, observe, unobserve
from uav_bt.tree.port import Port, Reference, bind_ports
from uav_bt.tree.script import Environment
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Status
from uav_bt.tree.variables import Variables

if TYPE_CHECKING:
    from abc import ABC
    from uuid import UUID

    class Behaviour(ABC):
        """What a node has of py_trees' class.

        The methods there take and return py_trees' statuses; to a type checker no class of ours
        could override them.
        """

        id: UUID
        name: str
        parent: Behaviour | None
        feedback_message: str

        def __init__(self, name: str) -> None: ...  # noqa: B027
        def iterate(self) -> Iterator[Node]: ...  # noqa: B027
else:
    from py_trees.behaviour import Behaviour

__all__ = ["Node", "NodeKind"]

T = TypeVar("T")

_NO_LITERAL: Final = object()
_ANSWERED: Final = {
    RUNNING.value: NodeEvent.CONTINUES,
    SUCCESS.value: NodeEvent.SUCCEEDED,
    FAILURE.value: NodeEvent.FAILED,
    SKIPPED.value: NodeEvent.SKIPPED,
}
_ANSWERS: Final = {event: Status(value) for value, event in _ANSWERED.items()}


class NodeKind(enum.Enum):
    """The kinds of nodes, named as the file format names them."""

    ACTION = "Action"
    CONDITION = "Condition"
    CONTROL = "Control"
    DECORATOR = "Decorator"
    SUBTREE = "SubTree"


class Node(Behaviour):
    """Base of every node.

    Args:
        name: the instance's name; default: the node's id.
        children: the nodes below it, in order.
        given: values of the ports, typed or as texts; a text in braces is a reference.

    Raises:
        InputError: a port is missing, unknown or has a value of another type.
        TypeError: a child is a py_trees behaviour, but none of our nodes.
    """

    node_id: ClassVar[str] = ""  # the XML tag; default: the class's name
    kind: ClassVar[NodeKind]
    ports: ClassVar[tuple[Port[Any], ...]] = ()
    min_children: ClassVar[int] = 0
    max_children: ClassVar[int | None] = 0  # None: as many as one likes

    children: list[Node]
    observer: Observer | None = None  # filled by `uav_bt.tree.observer.observe`

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if "node_id" not in cls.__dict__:
            cls.node_id = cls.__name__
        names = [port.name for port in cls.ports]
        if len(set(names)) != len(names):
            raise TypeError(f"{cls.__qualname__} declares a port twice: {', '.join(names)}")

    def __init__(
        self, name: str | None = None, children: Iterable[Node] = (), /, **given: object
    ) -> None:
        super().__init__(name or self.node_id)
        self.node_status = IDLE
        self.children = list(children)
        for child in self.children:
            if not isinstance(child, Node):
                raise TypeError(
                    f"a child of '{self.name}' must be a uav_bt.tree node, got "
                    f"{type(child).__name__}: make a leaf class of it with uav_bt.tree.leaf_of"
                )
            child.parent = self
        scripts = {key: str(given[key]) for key in given if key in CONDITION_ATTRIBUTES}
        values = {key: value for key, value in given.items() if key not in scripts}
        bound, wrong = bind_ports(self.ports, values, CONDITION_ATTRIBUTES)
        for key, script in scripts.items():
            message = check_condition(script)
            if message is not None:
                wrong[key] = f"attribute '{key}': {message}"
        if wrong:
            raise InputError(f"node '{self.name}' ({self.node_id}): {'; '.join(wrong.values())}")
        self._given = {key: at for key, at in bound.items() if isinstance(at, Reference)}
        self._references = self._given  # once placed: a subtree's variable may be a board key
        self._literals = {key: at for key, at in bound.items() if key not in self._given}
        self._variables = Variables()
        self._mission: MissionContext | None = None
        self._keys: dict[str, Key[Any]] = {}  # of the mission's board, by name, as they are used
        self._conditions = Conditions(scripts) if scripts else None
        self._environment: Environment | None = None
        self._visited: Status | None = None  # shown to a visitor of py_trees instead of the status
        self.path = self.name  # unique in its tree once the tree is made

    # --- surroundings -----------------------------------------------------------------------------

    @property
    def mission(self) -> MissionContext:
        """The mission that the tree was set up for.

        Raises:
            MissionError: it was not.
        """
        if self._mission is None:
            raise MissionError(f"node '{self.path}' is not set up: call MissionTree.setup first")
        return self._mission

    @property
    def clock(self) -> Clock:
        """The mission's clock."""
        return self.mission.clock

    @property
    def variables(self) -> Variables:
        """The variables of the tree that the node stands in."""
        return self._variables

    @property
    def environment(self) -> Environment:
        """What scripts of this node see."""
        if self._environment is None:
            board = None if self._mission is None else self._mission.board
            self._environment = Environment(self._variables, board)
        return self._environment

    @property
    def condition_scripts(self) -> dict[str, str]:
        """The scripts of the pre- and post-conditions by attribute."""
        if self._conditions is None:
            return {}
        return {name: script.source for name, script in self._conditions.scripts.items()}

    def place(self, path: str, variables: Variables) -> None:
        """Give the node its place in a tree; `MissionTree` does."""
        self.path = path
        self._variables = variables
        self._environment = None
        self._references = {
            name: self._placed(reference, variables) for name, reference in self._given.items()
        }

    @staticmethod
    def _placed(reference: Reference, variables: Variables) -> Reference:
        key = None if reference.on_board else variables.board_key(reference.key)
        return reference if key is None else Reference(key, on_board=True)

    def setup(self, mission: MissionContext | None = None, **_kwargs: Any) -> None:
        """Hand the node its mission; py_trees' own `BehaviourTree.setup(mission=...)` works too.

        Raises:
            MissionError: no mission was given.
        """
        if mission is None:
            raise MissionError(f"node '{self.path}': setup needs mission=MissionContext(...)")
        self._mission = mission
        self._keys = {}
        self._environment = None
        try:
            self._setup()
        except InputError:
            raise
        except Exception as error:
            raise NodeFailedError(self.path, error) from error

    def _setup(self) -> None:
        """Get ready for the first tick; for subclasses."""

    # --- ports ------------------------------------------------------------------------------------

    def port(self, port: Port[T]) -> T:
        """Return a port's value: the literal, or what its reference holds now.

        Raises:
            BoardAccessError: the reference holds nothing, nothing fresh, or another type.
        """
        value = self._literals.get(port.name, _NO_LITERAL)
        return self._resolve(port) if value is _NO_LITERAL else value

    def port_value(self, name: str) -> Any:
        """Return a port's value by the port's name."""
        value = self._literals.get(name, _NO_LITERAL)
        return self._resolve(self._declared(name)) if value is _NO_LITERAL else value

    def port_reading(self, port: Port[T]) -> Reading[T]:
        """Return a port's value with its age; a missing or stale one is no error."""
        reference = self._references.get(port.name)
        if reference is None:
            return Reading(self.port(port), 0.0)
        if reference.on_board:
            reading = self._read_board(self._board_key(reference))
            if reading.value is None:
                return Reading(None, reading.age_s)
            return Reading(self._converted(port, reading.value), reading.age_s)
        entry = self._variables.entry(reference.key)
        if entry is None:
            return Reading(None, float("inf"))
        return Reading(self._converted(port, entry.value), 0.0)

    def set_port(self, port: Port[T], value: T) -> None:
        """Write an output port's variable or board key; unconnected, it goes nowhere."""
        reference = self._references.get(port.name)
        if reference is None:
            return  # nobody connected it
        if reference.on_board:
            self._write_board(self._board_key(reference), value)
        else:
            self._variables[reference.key] = value

    def reference(self, port: Port[Any]) -> Reference | None:
        """Return what a port refers to, or None when it has a literal or is unconnected."""
        return self._references.get(port.name)

    def _declared(self, name: str) -> Port[Any]:
        for port in self.ports:
            if port.name == name:
                return port
        raise BoardAccessError(f"node '{self.path}' declares no port '{name}'")

    def _resolve(self, port: Port[T]) -> T:
        reference = self._references.get(port.name)
        if reference is None:
            raise BoardAccessError(f"node '{self.path}' declares no port '{port.name}'")
        if reference.on_board:
            value = self._board_value(self._board_key(reference))
        else:
            entry = self._variables.entry(reference.key)
            value = None if entry is None else entry.value
        if value is None:
            age_s = self.port_reading(port).age_s
            raise BoardAccessError(
                f"node '{self.path}', port '{port.name}': {self._given[port.name]} "
                f"holds nothing fresh (age {age_s:.2f} s)"
            )
        return self._converted(port, value)

    def _converted(self, port: Port[T], value: object) -> T:
        if type(value) is port.type and port.takes_all:
            return value
        try:
            return port.read(value)
        except ValueError as error:
            raise BoardAccessError(f"node '{self.path}', port '{port.name}': {error}") from error

    def _board_key(self, reference: Reference) -> Key[Any]:
        key = self._keys.get(reference.key)
        if key is None:
            key = self._keys[reference.key] = self.mission.board.key(reference.key)
        return key

    def _board_value(self, key: Key[T]) -> T | None:
        return self.mission.board.value(key)

    def _read_board(self, key: Key[T]) -> Reading[T]:
        return self.mission.board.read(key)

    def _write_board(self, key: Key[T], value: T) -> None:
        self.mission.board.write(key, value)

    # --- the tick ---------------------------------------------------------------------------------

    def execute_tick(self) -> Status:
        """Tick once and answer SUCCESS, FAILURE, RUNNING or SKIPPED.

        Raises:
            NodeFailedError: an exception came out of this node or of one below it.
        """
        try:
            conditions = self._conditions
            status = None if conditions is None else self._forestalled(conditions)
            if status is None:
                if self.observer is not None:
                    self._notify_work(self.observer)
                status = self._tick()
            if conditions is not None and (status is SUCCESS or status is FAILURE):
                conditions.ended(status, self.environment)
        except NodeFailedError as error:
            if self.observer is not None and error.node_path == self.path:
                self.observer(self, NodeEvent.RAISED)
            raise
        except Exception as error:
            if self.observer is not None:
                self.observer(self, NodeEvent.RAISED)
            raise NodeFailedError(self.path, error) from error
        if status is not SKIPPED:
            self.set_status(status)
        if self.observer is not None:
            self.observer(self, _ANSWERED[status.value])
        return status

    def _forestalled(self, conditions: Conditions) -> Status | None:
        status = conditions.forestall(self.node_status, self.environment)
        if status is SKIPPED and self.node_status is RUNNING:
            self.halt()
        return status

    def update(self) -> Status:
        """Do one tick's work, at once, and answer; the conditions have let it through.

        Raises:
            NotImplementedError: the class does not say what it does.
        """
        raise NotImplementedError(f"{type(self).__qualname__} must define update()")

    def _notify_work(self, observer: Observer) -> None:
        observer(self, NodeEvent.RAN if self.node_status is RUNNING else NodeEvent.STARTED)

    def set_status(self, status: Status) -> None:
        """Let the node stand in a status; for the engine and for nodes written in Python."""
        if self.node_status is not status:
            self.node_status = status
            if self.observer is not None:
                self.observer(self, NodeEvent.STATUS)

    def halt(self) -> None:
        """Stop what is going on below and here; `terminate` of leaves that run is called.

        Raises:
            NodeFailedError: a leaf's `terminate` or a script raised.
        """
        observer = self.observer if self.node_status is RUNNING else None
        if observer is not None:
            observer(self, NodeEvent.HALTING)
        try:
            self._halt()
            if self._conditions is not None:
                self._conditions.halted(self.environment)
        except NodeFailedError:
            raise
        except Exception as error:
            raise NodeFailedError(self.path, error) from error
        finally:
            if observer is not None:
                observer(self, NodeEvent.HALTED)

    def reset(self) -> None:
        """Halt when running, then stand idle."""
        if self.node_status is RUNNING:
            self.halt()
        self.set_status(IDLE)

    def _tick(self) -> Status:
        return self.update()

    def _halt(self) -> None:
        for child in self.children:
            child.reset()
        self.set_status(IDLE)

    # --- py_trees' side ---------------------------------------------------------------------------

    @property
    def status(self) -> common.Status:
        """The status in py_trees' terms; while a visitor sees the node, what its tick answered."""
        return (self._visited or self.node_status).py_trees

    @status.setter
    def status(self, status: common.Status) -> None:
        """Ignore the assignment of py_trees' constructor; `stop` is how py_trees changes it."""

    def tick(self) -> Iterator[Behaviour]:
        """Tick as py_trees does, yielding every ticked node, children first, for its visitors.

        Each node shows the status that its tick answered while it is being visited.
        """
        if self.node_status is SUCCESS or self.node_status is FAILURE:
            self.reset()
        visits: list[tuple[Node, Status]] = []

        def note(node: Node, event: NodeEvent) -> None:
            if event in _ANSWERS:
                visits.append((node, _ANSWERS[event]))

        nodes = list(self.iterate())
        observe(nodes, note)
        try:
            self.execute_tick()
        finally:
            unobserve(nodes, note)
        for node, answered in visits:
            node._visited = answered  # noqa: SLF001  # of the same class
            try:
                yield node
            finally:  # py_trees' composites leave the generator here
                node._visited = None  # noqa: SLF001

    def stop(self, new_status: common.Status = common.Status.INVALID) -> None:
        """Stop from outside, as py_trees' composites do."""
        if new_status is common.Status.INVALID:
            self.reset()
        else:
            self.set_status(Status[new_status.name])
