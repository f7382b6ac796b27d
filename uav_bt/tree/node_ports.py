"""Base class of `Node`: its ports, and what it states about variables."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Final, TypeVar

from uav_bt.board.blackboard import Blackboard, BoardView, Key
from uav_bt.board.context import MissionContext
from uav_bt.errors import (
    BoardAccessError,
    InputError,
    MissionError,
    UnknownValueError,
    did_you_mean,
)
from uav_bt.protocols import Clock
from uav_bt.tree.port import Port, Reference, bind_ports
from uav_bt.tree.script.parser import Script
from uav_bt.tree.script.values import Environment
from uav_bt.tree.variables import After, Follow, Known, Variables

T = TypeVar("T")

_NO_LITERAL: Final = object()
BOUND: Final = "="  # the keyword of bound values; no attribute has this name


@dataclass(frozen=True)
class Written:
    """A variable that a node writes when it succeeds."""

    attribute: str
    name: str | None  # in the node's own tree; None: known in flight only
    kind: type = object  # of the value; object: unknown
    value: str | None = None  # where the file has it
    elements: tuple[str, ...] = ()  # the values, one after another, where the file has them
    copied: Reference | None = None  # whose value it is
    port: Port[Any] | None = None  # None: named by a text
    keeps_type: bool = False  # an existing variable keeps its type


class NodePorts:
    """Ports of a node, and the mission and variables that they read and write.

    `Node` adds the children and the tick.
    """

    node_id: ClassVar[str] = ""  # the XML tag; default: the class's name
    ports: ClassVar[tuple[Port[Any], ...]] = ()

    ticks_again: ClassVar[bool] = False  # ticks its children in several rounds
    ticks_together: ClassVar[bool] = False  # ticks several children in the same tick
    asks_first: ClassVar[bool] = False  # its first child is a condition, which must not be skipped

    name: str
    children: list[Any]
    path: str  # unique in its tree once the tree is made
    variables: Variables  # of the tree that the node stands in
    literals: dict[str, Any]  # values of ports that are no references, by port, with defaults
    given_references: dict[str, Reference]  # as they were given, by port

    _mission: MissionContext | None
    _keys: dict[str, Key[Any]]  # of the mission's board, by name, as they are used
    _environment: Environment | None

    @classmethod
    def ports_over(cls, children: int) -> tuple[Port[Any], ...]:
        """Return the ports with the ranges that hold over a number of children."""
        del children
        return cls.ports

    def _bind(self, given: dict[str, Any], children: int, wrong: dict[str, str]) -> None:
        """Bind the ports to values by port, or to those that the loader has bound, as `BOUND`.

        An InputError names what is missing, unknown or of another type, after what was `wrong`.
        """
        bound = given.pop(BOUND, None)
        if bound is None:
            bound, wrong_ports = bind_ports(self.ports_over(children), given)
            if messages := [*wrong_ports.values(), *wrong.values()]:
                raise InputError(f"node '{self.name}' ({self.node_id}): {'; '.join(messages)}")
        self.given_references = {key: at for key, at in bound.items() if isinstance(at, Reference)}
        self.literals = {key: one for key, one in bound.items() if not isinstance(one, Reference)}
        self._references = self.given_references  # once placed: a variable may be a board key

    def __repr__(self) -> str:
        given = {**self.literals, **self.given_references}
        values = "".join(f", {name}={given[name]}" for name in given)
        return f"<{type(self).__name__} '{self.path}'{values}>"

    @property
    def mission(self) -> MissionContext:
        """The mission that the tree was set up for."""
        if self._mission is None:
            raise MissionError(f"node '{self.path}' is not set up: call MissionTree.setup first")
        return self._mission

    @property
    def has_mission(self) -> bool:
        """Whether the node was set up for a mission, now or before."""
        return self._mission is not None

    @property
    def author(self) -> type:
        """The class whose code runs when the node does; errors name its file and line."""
        return type(self)

    @property
    def clock(self) -> Clock:
        """The mission's clock."""
        return self.mission.clock

    @property
    def environment(self) -> Environment:
        """Variables and board that scripts of this node use."""
        if self._environment is None:
            board = None if self._mission is None else self._mission.board
            self._environment = Environment(self.variables, board)
        return self._environment

    def _set_place(self, path: str, variables: Variables) -> None:
        """Give the node its path and the variables of its tree."""
        self.path, self.variables, self._environment = path, variables, None
        self._references = dict(self.given_references)
        for name, at in self.given_references.items():
            key = None if at.on_board else variables.board_key(at.key)
            if key is not None:
                self._references[name] = Reference(key, on_board=True)

    @property
    def _board(self) -> Blackboard | BoardView:
        """The mission's board; for a leaf a view that allows the declared keys."""
        return self.mission.board

    # --- ports ------------------------------------------------------------------------------------

    def port(self, port: Port[T]) -> T:
        """Return a port's value: the literal, or the present value of its reference.

        Raises:
            BoardAccessError: the variable holds nothing, or the value has another type.
            UnknownValueError: the board key has no fresh value.
        """
        value = self.literals.get(port.name, _NO_LITERAL)
        return self._resolved(port) if value is _NO_LITERAL else value

    def port_value(self, name: str) -> Any:
        """Return a port's value by the port's name."""
        value = self.literals.get(name, _NO_LITERAL)
        if value is not _NO_LITERAL:
            return value
        return self._resolved(self._declared(name, "port", self.ports))

    def initial_value(self, port: Port[T]) -> T | None:
        """Return a port's value before the tree runs; None where only the flight gives one.

        It is the literal, or the entry of a subtree that is the variable's first value.
        """
        if port.name in self.literals:
            return self.port(port)
        at = self._references.get(port.name)
        value = None if at is None or at.on_board else self.variables.get(at.key)
        return None if value is None else self._converted(port, value)

    def held(self, port: Port[T]) -> T | None:
        """Return a port's present value; None where its reference holds nothing, or nothing fresh.

        A value of another type is a BoardAccessError, as is a port that the node does not have.
        """
        value = self.literals.get(port.name, _NO_LITERAL)
        return self._present(port) if value is _NO_LITERAL else value

    def _present(self, port: Port[T]) -> T | None:
        at = self._references.get(port.name)
        if at is None:
            raise BoardAccessError(f"node '{self.path}' declares no port '{port.name}'")
        if at.on_board:
            value = self._board.value(self._board_key(at))
        else:
            entry = self.variables.entry(at.key)
            value = None if entry is None else entry.value
        if type(value) is port.type and port.takes_all:  # as most values are
            return value
        return None if value is None else self._converted(port, value)

    def set_port(self, port: Port[T] | str, value: T) -> None:
        """Write the variable or board key of an output port, given as such or by its name.

        An unconnected port writes nothing. A BoardAccessError names a port that the node lacks.
        """
        outputs = [one for one in self.ports if one.direction != "input"]
        name = port if isinstance(port, str) else port.name
        at = self._references.get(self._declared(name, "output port", outputs).name)
        if at is None:
            return  # not connected
        if at.on_board:
            self._board.write(self._board_key(at), value)
        else:
            self.variables[at.key] = value

    def _declared(self, name: str, what: str, ports: Iterable[Port[Any]]) -> Port[Any]:
        """Return the port of a name among some of the node's."""
        by_name = {port.name: port for port in ports}
        if name not in by_name:
            hint = did_you_mean(name, by_name) + f" (known: {', '.join(by_name) or 'none'})"
            raise BoardAccessError(f"node '{self.path}' declares no {what} '{name}'{hint}")
        return by_name[name]

    def reference(self, port: Port[Any]) -> Reference | None:
        """Return a port's reference, or None when it has a literal or is unconnected."""
        return self._references.get(port.name)

    def script_at(self, port: Port[Any]) -> Script | None:
        """Return the script that a port's literal is, if it is one."""
        return port.script(self.literals.get(port.name))

    def _resolved(self, port: Port[T]) -> T:
        value = self._present(port)
        if value is not None:
            return value
        at = self._references[port.name]
        what = f"node '{self.path}', port '{port.name}': {self.given_references[port.name]}"
        if not at.on_board:
            raise BoardAccessError(f"{what} holds nothing")
        key = self._board_key(at)
        age_s = self._board.read(key).age_s
        if math.isfinite(age_s):
            raise UnknownValueError(f"{what} holds nothing fresh (age {age_s:.2f} s)")
        hint = f"; {key.writer} writes it" if key.writer else ""
        raise UnknownValueError(f"{what} was never written{hint}")

    def _converted(self, port: Port[T], value: object) -> T:
        try:
            return port.read(value)
        except ValueError as error:
            raise BoardAccessError(f"node '{self.path}', port '{port.name}': {error}") from error

    def _board_key(self, at: Reference) -> Key[Any]:
        key = self._keys.get(at.key)
        if key is None:
            key = self._keys[at.key] = self.mission.board.key(at.key)
        return key

    # --- variables, for checks before the flight; a new node overrides what differs ---------------

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Return the variables with a value after this node; nothing is assumed of its children."""
        for child in self.children:
            follow(child, known)
        return After(known, known, known)

    def variables_written(self) -> Iterator[Written]:
        """Yield the variables that the node writes: those at its output ports."""
        for port in self.ports:
            at = self.given_references.get(port.name)
            if port.direction != "input" and at is not None and not at.on_board:
                yield Written(port.name, at.key, port.type, port=port)

    def variables_removed(self) -> Iterator[str]:
        """Yield the names of the variables that the node removes."""
        return iter(())

    def needs_value(self, port: Port[Any]) -> bool:
        """Return whether the node fails where the variable at an input port has no value."""
        return port.type is not object


def child_paths(parent: str, names: Sequence[str]) -> list[str]:
    """Return the paths of a node's children by their names; the second of one name gets `#2`."""
    seen: Counter[str] = Counter()
    paths: list[str] = []
    for name in names:
        seen[name] += 1
        paths.append(f"{parent}/{name}" + (f"#{seen[name]}" if seen[name] > 1 else ""))
    return paths
