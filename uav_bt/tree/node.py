"""Base class of all nodes: children, place in the tree, and the tick.

A node is ticked through `execute_tick`, plain calls that follow BehaviorTree.CPP 4.10 step by step.
py_trees has another model of a tick (generators, four statuses, a composite per policy), so none of
its engine is used. A node is a `py_trees.behaviour.Behaviour` for the sake of py_trees' tools: it
has that class's id, children, parent, feedback message and `iterate`, and answers `setup`, `tick`,
`stop` and `status` as they expect. `status` is py_trees' status; `node_status` is ours.
"""

from __future__ import annotations

import enum
import logging
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, ClassVar, Final

from py_trees import common

from uav_bt.board.context import NO_CONTEXT, MissionContext
from uav_bt.errors import InputError, MissionError, NodeFailedError, UnknownValueError
from uav_bt.tree.node_ports import NodePorts, child_paths
from uav_bt.tree.observer import ANSWERS, NodeEvent, Observer, observe, unobserve
from uav_bt.tree.port import CONDITION_ATTRIBUTES, Port, check_declared
from uav_bt.tree.script.parser import Script, parse_question
from uav_bt.tree.script.values import ScriptError, truth
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Status
from uav_bt.tree.variables import Variables

if TYPE_CHECKING:
    from abc import ABC

    class Behaviour(ABC):
        """For type checkers, which refuse to override the real class's statuses with ours."""

        name: str
        parent: Behaviour | None
        feedback_message: str

        def __init__(self, name: str) -> None: ...  # noqa: B027
        def iterate(self) -> Iterator[Node]: ...  # noqa: B027, D102
        def shutdown(self) -> None: ...  # noqa: B027, D102
else:
    from py_trees.behaviour import Behaviour

_log: Final = logging.getLogger(__name__)

_ANSWERED: Final = {status.value: event for event, status in ANSWERS.items()}
# Conditions in the engine's order, each with the status that a true one gives an idle node.
_FORESTALLING: Final = (("_failureIf", FAILURE), ("_successIf", SUCCESS), ("_skipIf", SKIPPED))


class NodeKind(enum.Enum):
    """The kinds of nodes, named as the file format names them."""

    ACTION = "Action"
    CONDITION = "Condition"
    CONTROL = "Control"
    DECORATOR = "Decorator"
    SUBTREE = "SubTree"


class Node(NodePorts, Behaviour):
    """Base of every node.

    Args:
        name: the instance's name; default: the node's id.
        children: the nodes below it, in order.
        given: values of the ports, typed or as texts; a text in braces is a reference.

    Raises:
        InputError: a port is missing, unknown or has a value of another type.
        TypeError: a child is a py_trees behaviour, but none of our nodes.
    """

    kind: ClassVar[NodeKind]
    min_children: ClassVar[int] = 0
    max_children: ClassVar[int | None] = 0  # None: as many as one likes

    children: list[Node]
    visited: Status | None = None  # shown to a visitor of py_trees instead of the status
    _told_unknown = False  # the log has a failure for an unknown value

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if "node_id" not in cls.__dict__:
            cls.node_id = cls.__name__
        check_declared(cls, "ports", Port)
        names = [port.name for port in cls.ports]
        if len(set(names)) != len(names):
            raise TypeError(f"{cls.__qualname__} declares a port twice: {', '.join(names)}")

    def __init__(
        self, name: str | None = None, children: Iterable[Node] = (), /, **given: object
    ) -> None:
        super().__init__(name or self.node_id)
        self.node_status = IDLE
        self.observers: tuple[Observer, ...] = ()  # filled by `uav_bt.tree.observer.observe`
        self._mission = None
        self._environment = None
        self.children = list(children)
        for child in self.children:
            if not isinstance(child, Node):
                got = f"{type(child).__name__}: make a leaf class of it with uav_bt.tree.leaf_of"
                if isinstance(child, type):
                    got = f"the class {child.__name__}: write {child.__name__}(...)"
                raise TypeError(f"a child of '{self.name}' must be a uav_bt.tree node, got {got}")
            child.parent = self
        texts = {name: str(given.pop(name)) for name in [*given] if name in CONDITION_ATTRIBUTES}
        self.condition_scripts: dict[str, str] = texts  # by attribute
        self._conditions: dict[str, Script] = {}
        wrong: dict[str, str] = {}
        for key, text in texts.items():
            try:
                self._conditions[key] = parse_question(text)
            except ScriptError as error:
                wrong[key] = f"attribute '{key}': {error}"
        self._bind(given, len(self.children), wrong)
        self.path, self.variables = self.name, Variables()

    # --- the tree ---------------------------------------------------------------------------------

    def scripts(self) -> Iterator[tuple[str, Script]]:
        """Yield the scripts by attribute: the conditions, and those of ports."""
        yield from self._conditions.items()
        for port in self.ports:
            if (script := self.script_at(port)) is not None:
                yield port.name, script

    def open_scope(self, outer: Variables) -> Variables:
        """Return the variables that the children use; `outer` are those of the node's tree."""
        return outer

    def place(self, path: str, variables: Variables) -> None:
        """Place the node in the variables of its tree, and all below; a subtree gets a scope."""
        self._set_place(path, variables)
        inner = self.open_scope(variables)
        paths = child_paths(path, [child.name for child in self.children])
        for child, child_path in zip(self.children, paths, strict=True):
            child.place(child_path, inner)

    def rebind(self, given: Mapping[str, object]) -> None:
        """Replace values of ports, before the setup; an InputError says what is wrong."""
        references = {name: str(at) for name, at in self.given_references.items()}
        self._bind({**self.literals, **references, **given}, len(self.children), {})
        self.place(self.path, self.variables)

    def setup(self, mission: MissionContext | None = None, **_kwargs: Any) -> None:
        """Hand the node its mission; py_trees' own `BehaviourTree.setup(mission=...)` works too."""
        if mission is None:
            raise MissionError(f"node '{self.path}': {NO_CONTEXT}")
        self._mission = mission
        self._keys = {}
        self._environment = None
        with self.failing(InputError):
            self._setup()

    def _setup(self) -> None:
        """Get ready for the first tick; for subclasses."""

    def _failure(self, error: Exception) -> NodeFailedError:
        return NodeFailedError(self.path, error, self.author)

    @contextmanager
    def failing(self, *passed: type[Exception]) -> Iterator[None]:
        """Raise an exception as the node's failure, unless it is of a class that is passed on."""
        try:
            yield
        except passed:
            raise
        except Exception as error:
            raise self._failure(error) from error

    # --- the tick ---------------------------------------------------------------------------------

    def execute_tick(self) -> Status:
        """Tick once and answer SUCCESS, FAILURE, RUNNING or SKIPPED.

        A node of which a script or a port reads a board key without a fresh value answers FAILURE.

        Raises:
            NodeFailedError: an exception came out of this node or of one below it.
        """
        observers = self.observers
        try:
            try:
                if not observers and not self._conditions:  # as most nodes are
                    status = self._tick()
                else:
                    status = self._tick_guarded()
            except UnknownValueError as unknown:
                status = self._fail(unknown)
        except Exception as error:
            failure = error if isinstance(error, NodeFailedError) else self._failure(error)
            if failure.node_path == self.path:
                self._notify(NodeEvent.RAISED)
            if failure is error:
                raise
            raise failure from error
        if observers:
            if status is not SKIPPED:
                self.set_status(status)
            self._notify(_ANSWERED[status.value])
        elif status is not SKIPPED:
            self.node_status = status
        return status

    def _tick_guarded(self) -> Status:
        """Tick with observers and conditions."""
        try:
            status = self._forestalled() if self._conditions else None
            if status is None:
                self._notify_work()
                status = self._tick()
            elif status is SKIPPED and self.node_status is RUNNING:
                self.halt()
        except UnknownValueError as unknown:
            status = self._fail(unknown)
        if status is SUCCESS or status is FAILURE:
            try:
                self._run("_onSuccess" if status is SUCCESS else "_onFailure")
                self._run("_post")
            except UnknownValueError as unknown:
                self._tell(unknown)
                status = FAILURE
        return status

    def _forestalled(self) -> Status | None:
        """Return the status that replaces the tick, or None; a running node is asked `_while`."""
        scripts = self._conditions
        if self.node_status is IDLE:
            for name, status in _FORESTALLING:
                if name in scripts and truth(scripts[name].run(self.environment)):
                    return status
        elif self.node_status is not RUNNING:
            return None
        goes_on = "_while" not in scripts or truth(scripts["_while"].run(self.environment))
        return None if goes_on else SKIPPED

    def _run(self, condition: str) -> None:
        if condition in self._conditions:
            self._conditions[condition].run(self.environment)

    def _fail(self, unknown: UnknownValueError) -> Status:
        """End the node because it reads a value that is not known; halt what runs below it."""
        self._tell(unknown)
        for child in self.children:
            child.reset()
        return FAILURE

    def _tell(self, unknown: UnknownValueError) -> None:
        """Log the reason of a failure, once for a node."""
        self.feedback_message = str(unknown)
        if not self._told_unknown:
            self._told_unknown = True
            _log.warning("Warning: node '%s' fails: %s", self.path, unknown)

    def update(self) -> Status:
        """Do the work of one tick, without blocking, and return the status."""
        raise NotImplementedError(f"{type(self).__qualname__} must define update()")

    def _notify(self, event: NodeEvent) -> None:
        for observer in self.observers:
            observer(self, event)

    def _notify_work(self) -> None:
        self._notify(NodeEvent.RAN if self.node_status is RUNNING else NodeEvent.STARTED)

    def set_status(self, status: Status) -> None:
        """Set the status; for the engine and for nodes written in Python."""
        if self.node_status is not status:
            self.node_status = status
            if self.observers:
                self._notify(NodeEvent.STATUS)

    def halt(self) -> None:
        """Stop this node and all below; running leaves get `terminate`."""
        ran = self.node_status is RUNNING
        if ran:
            self._notify(NodeEvent.HALTING)
        try:
            with self.failing(UnknownValueError, NodeFailedError):
                self._halt()
                self._run("_onHalted")
        except UnknownValueError as unknown:
            self._tell(unknown)
        finally:
            if ran:
                self._notify(NodeEvent.HALTED)

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
        return (self.visited or self.node_status).py_trees

    @status.setter
    def status(self, status: common.Status) -> None:
        """Ignore the assignment of py_trees' constructor; `stop` is how py_trees changes it."""

    def tick(self) -> Iterator[Behaviour]:
        """Tick as py_trees does, and yield every node that was ticked, children first.

        While a visitor of py_trees looks at a node, the node shows the answer of its tick.
        """
        if self.node_status is SUCCESS or self.node_status is FAILURE:
            self.reset()
        visits: list[tuple[Node, Status]] = []

        def note(ticked: Node, event: NodeEvent) -> None:
            if event in ANSWERS:
                visits.append((ticked, ANSWERS[event]))

        nodes = list(self.iterate())
        observe(nodes, note)
        try:
            self.execute_tick()
        finally:
            unobserve(nodes, note)
        for ticked, answered in visits:
            ticked.visited = answered
            try:
                yield ticked
            finally:  # py_trees' composites leave the generator here
                ticked.visited = None

    def stop(self, new_status: common.Status = common.Status.INVALID) -> None:
        """Stop from outside, as py_trees' composites do."""
        if new_status is common.Status.INVALID:
            self.reset()
        else:
            self.set_status(Status[new_status.name])
