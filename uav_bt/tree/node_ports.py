"""Base class of `Node` that binds, reads and writes ports."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar, Final, TypeVar

from uav_bt.board.blackboard import Blackboard, BoardView, Key, Reading
from uav_bt.board.context import MissionContext
from uav_bt.errors import BoardAccessError, InputError, MissionError, UnknownValueError
from uav_bt.protocols import Clock
from uav_bt.tree.conditions import CONDITION_ATTRIBUTES
from uav_bt.tree.port import Port, Reference, bind_ports
from uav_bt.tree.script import Environment
from uav_bt.tree.variables import Variables

T = TypeVar("T")

_NO_LITERAL: Final = object()
BOUND: Final = "="  # the keyword of bound values; no attribute has this name


class NodePorts:
    """Ports of a node, and the mission and variables that they read and write.

    `Node` adds the children and the tick.
    """

    node_id: ClassVar[str] = ""  # the XML tag; default: the class's name
    ports: ClassVar[tuple[Port[Any], ...]] = ()

    name: str
    path: str  # unique in its tree once the tree is made

    @classmethod
    def ports_over(cls, children: int) -> tuple[Port[Any], ...]:
        """Return the ports with the ranges that hold over a number of children."""
        del children
        return cls.ports

    def _bind(self, given: dict[str, object], children: int, wrong: dict[str, str]) -> None:
        """Bind the ports to the given values.

        Args:
            given: values by port; or those that the loader has bound, as `BOUND`.
            children: how many children the node has.
            wrong: errors of other attributes, for the same message.

        Raises:
            InputError: a port is missing, unknown or has a value of another type.
        """
        self._ports = self.ports_over(children)
        bound: Any = given.pop(BOUND, None)
        if bound is None:
            bound, wrong_ports = bind_ports(self._ports, given, CONDITION_ATTRIBUTES)
            if messages := [*wrong_ports.values(), *wrong.values()]:
                raise InputError(f"node '{self.name}' ({self.node_id}): {'; '.join(messages)}")
        self._given = {key: at for key, at in bound.items() if isinstance(at, Reference)}
        self._references = self._given  # once placed: a subtree's variable may be a board key
        self._literals = {key: at for key, at in bound.items() if key not in self._given}
        self._variables = Variables()
        self._mission: MissionContext | None = None
        self._keys: dict[str, Key[Any]] = {}  # of the mission's board, by name, as they are used
        self._environment: Environment | None = None
        self.path = self.name

    def __repr__(self) -> str:
        given = {**self._literals, **self._given}
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
    def variables(self) -> Variables:
        """The variables of the tree that the node stands in."""
        return self._variables

    @property
    def environment(self) -> Environment:
        """Variables and board that scripts of this node use."""
        if self._environment is None:
            board = None if self._mission is None else self._mission.board
            self._environment = Environment(self._variables, board)
        return self._environment

    def rebind(self, given: Mapping[str, object]) -> None:
        """Replace the values of ports, before the setup.

        Args:
            given: values by port, typed or as texts.

        Raises:
            InputError: the node has no such port, or a value does not fit.
        """
        unknown = given.keys() - {port.name for port in self._ports}
        ports = self._ports if unknown else [port for port in self._ports if port.name in given]
        bound, wrong = bind_ports(ports, dict(given))
        if wrong:
            raise InputError(f"node '{self.name}' ({self.node_id}): {'; '.join(wrong.values())}")
        for key, at in bound.items():
            old, new = self._literals, self._given
            if not isinstance(at, Reference):
                old, new = new, old
            old.pop(key, None)
            new[key] = at
        self.place(self.path, self._variables)

    def place(self, path: str, variables: Variables) -> None:
        """Give the node its path and the variables of its tree; `MissionTree` does."""
        self.path = path
        self._variables = variables
        self._environment = None
        self._references = dict(self._given)
        for name, reference in self._given.items():
            key = None if reference.on_board else variables.board_key(reference.key)
            if key is not None:
                self._references[name] = Reference(key, on_board=True)

    @property
    def _board(self) -> Blackboard | BoardView:
        """The mission's board; for a leaf a view that allows the declared keys."""
        return self.mission.board

    @property
    def given_references(self) -> Mapping[str, Reference]:
        """The references of ports as they were given, by port."""
        return self._given

    @property
    def literals(self) -> Mapping[str, Any]:
        """The values of ports that are no references, by port, defaults included."""
        return self._literals

    # --- ports ------------------------------------------------------------------------------------

    def port(self, port: Port[T]) -> T:
        """Return a port's value: the literal, or the present value of its reference.

        Raises:
            BoardAccessError: the variable holds nothing, or the value has another type.
            UnknownValueError: the board key has no fresh value.
        """
        value = self._literals.get(port.name, _NO_LITERAL)
        return self._resolve(port) if value is _NO_LITERAL else value

    def port_value(self, name: str) -> Any:
        """Return a port's value by the port's name."""
        value = self._literals.get(name, _NO_LITERAL)
        return self._resolve(self._declared(name)) if value is _NO_LITERAL else value

    def initial_value(self, port: Port[T]) -> T | None:
        """Return a port's value before the tree runs; None where only the flight gives one.

        It is the literal, or the entry of a subtree that is the variable's first value.
        """
        if port.name in self._literals:
            return self.port(port)
        reference = self._references.get(port.name)
        if reference is None or reference.on_board:
            return None
        entry = self._variables.entry(reference.key)
        return None if entry is None else self._converted(port, entry.value)

    def port_reading(self, port: Port[T]) -> Reading[T]:
        """Return a port's value with its age, without an error for a missing or stale value."""
        reference = self._references.get(port.name)
        if reference is None:
            return Reading(self.port(port), 0.0)
        if reference.on_board:
            reading: Reading[Any] = self._board.read(self._board_key(reference))
        else:
            entry = self._variables.entry(reference.key)
            reading = Reading(None, math.inf) if entry is None else Reading(entry.value, 0.0)
        if reading.value is None:
            return reading
        return Reading(self._converted(port, reading.value), reading.age_s)

    def set_port(self, port: Port[T], value: T) -> None:
        """Write an output port's variable or board key; an unconnected port writes nothing."""
        reference = self._references.get(port.name)
        if reference is None:
            return  # not connected
        if reference.on_board:
            self._board.write(self._board_key(reference), value)
        else:
            self._variables[reference.key] = value

    def reference(self, port: Port[Any]) -> Reference | None:
        """Return a port's reference, or None when it has a literal or is unconnected."""
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
            value = self._board.value(self._board_key(reference))
        else:
            entry = self._variables.entry(reference.key)
            value = None if entry is None else entry.value
        if value is not None:
            return self._converted(port, value)
        what = f"node '{self.path}', port '{port.name}': {self._given[port.name]}"
        if not reference.on_board:
            raise BoardAccessError(f"{what} holds nothing")
        age_s = self.port_reading(port).age_s
        if math.isfinite(age_s):
            raise UnknownValueError(f"{what} holds nothing fresh (age {age_s:.2f} s)")
        writer = self._board_key(reference).writer
        hint = f"; {writer} writes it" if writer else ""
        raise UnknownValueError(f"{what} was never written{hint}")

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
