"""Plain py_trees behaviours as leaves of tree files."""

from __future__ import annotations

import enum
import inspect
import logging
from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any, ClassVar, Final, get_type_hints

from py_trees import common, decorators, timers
from py_trees.behaviour import Behaviour

from uav_bt.board.context import MissionContext
from uav_bt.errors import InputError, MissionError
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.node import Node
from uav_bt.tree.port import Port, Reference, parse_reference
from uav_bt.tree.status import FAILURE, RUNNING, SKIPPED, SUCCESS, Status

_log: Final = logging.getLogger(__name__)

_OF_WALL_CLOCK: Final = (timers.Timer, decorators.Timeout)
_TYPES: Final = (str, int, float, bool)
_EXPECTED: Final = "annotate it with str, int, float, bool or an enumeration"


class _ConstructorPort(Port[Any]):
    """A constructor argument. It must be a literal, since it is needed before the tree runs."""

    def bind(self, given: object) -> Any | Reference:
        """Return the typed value.

        Raises:
            ValueError: the value is a reference or does not fit the port.
        """
        if isinstance(given, str) and parse_reference(given, self.name) is not None:
            raise ValueError(
                f"a py_trees behaviour is constructed before any variable has a value: "
                f"expected a literal, got '{given}'"
            )
        return super().bind(given)


class ForeignLeaf(Leaf):
    """Ticks an unmodified py_trees behaviour.

    The behaviour is constructed and set up with the tree. The `tick` of py_trees ticks it, so its
    methods are called in the order that py_trees documents. Halting the leaf stops the behaviour
    with INVALID. A tick that answers INVALID counts as SKIPPED. An answer that is not a status
    raises, because py_trees would turn it into INVALID. Inside a composite of py_trees, which
    cannot pass INVALID on, that answer raises, too.
    """

    answers = (SUCCESS, FAILURE, RUNNING, SKIPPED)
    behaviour_class: ClassVar[type[Behaviour]]
    enums: ClassVar[dict[str, type[enum.Enum]]]  # enumerations of the constructor, by argument

    def __init__(self, name: str | None = None, /, **given: object) -> None:
        super().__init__(name, **given)
        arguments: dict[str, Any] = {
            key: self.enums[key][value] if key in self.enums else value
            for key, value in self._literals.items()
        }
        if "name" in inspect.signature(self.behaviour_class).parameters:
            arguments["name"] = self.name
        try:
            self.behaviour = _answering(self.behaviour_class)(**arguments)
        except Exception as error:
            raise InputError(
                f"node '{self.name}' ({self.node_id}) cannot be constructed: "
                f"{type(error).__name__}: {error}"
            ) from error
        self._active = False  # ticked and still running

    @property
    def author(self) -> type:
        """The behaviour's class."""
        return self.behaviour_class

    def on_setup(self, mission: MissionContext) -> None:
        """Set the behaviour up."""
        del mission
        self.behaviour.setup_with_descendants()
        theirs = (one for one in self.behaviour.iterate() if not isinstance(one, Node))
        warn_of_wall_clock(self.path, theirs)

    def on_shutdown(self) -> None:
        """Shut down the behaviour and its descendants."""
        for behaviour in self.behaviour.iterate():
            behaviour.shutdown()

    def update(self) -> Status:
        """Tick the behaviour and return its answer."""
        self._active = True
        for ticked in self.behaviour.tick():
            inside = ticked is not self.behaviour and not isinstance(ticked, Node)
            if inside and ticked.status is common.Status.INVALID:
                raise no_status(ticked, "INVALID or another value")
        self.feedback_message = self.behaviour.feedback_message
        answered = self.behaviour.status
        status = SKIPPED if answered is common.Status.INVALID else Status[answered.name]
        self._active = status is RUNNING
        return status

    def terminate(self, new_status: Status) -> None:
        """Stop the behaviour if it is still running."""
        del new_status
        if self._active:
            self._active = False
            self.behaviour.stop(common.Status.INVALID)


def _answering(behaviour: type[Behaviour]) -> type[Behaviour]:
    """Return a subclass whose `update` raises MissionError for an answer that is not a status."""

    def update(self: Behaviour) -> common.Status:
        status = behaviour.update(self)
        if not isinstance(status, common.Status):
            raise no_status(self, repr(status))
        return status

    body = {"__module__": behaviour.__module__, "__qualname__": behaviour.__qualname__}
    return type(behaviour.__name__, (behaviour,), {**body, "update": update})


def warn_of_wall_clock(path: str, behaviours: Iterable[Behaviour]) -> None:
    """Log a warning for each timer of py_trees.

    Args:
        path: Path of the node that ticks the behaviours.
        behaviours: Behaviours of py_trees.
    """
    for behaviour in behaviours:
        if isinstance(behaviour, _OF_WALL_CLOCK):
            _log.warning(
                "Warning: node '%s': '%s' of py_trees measures the computer's clock, not the "
                "mission's; in a tree file use Sleep, Delay or Timeout",
                path,
                type(behaviour).__name__,
            )


def no_status(behaviour: Behaviour, answer: str) -> MissionError:
    """Return the error for an answer of a behaviour that is not a status.

    Args:
        behaviour: Behaviour of py_trees.
        answer: Description of its answer.
    """
    name = type(behaviour).__qualname__
    return MissionError(f"update() of {name} must return a status of py_trees, got {answer}")


@cache
def leaf_of(behaviour: type[Behaviour]) -> type[ForeignLeaf]:
    """Return a leaf class that ticks behaviours of a plain py_trees class.

    Its ports are the constructor's annotated arguments: `str`, `int`, `float`, `bool` or an
    enumeration, given by its member's name. An argument with a default is an optional port; `name`
    is the node's name; `*args` and `**kwargs` are left empty.

    Raises:
        InputError: the class is not a py_trees behaviour, or an argument lacks such an annotation.
    """
    if not issubclass(behaviour, Behaviour) or issubclass(behaviour, Node):
        raise InputError(f"expected a class of py_trees behaviours, got {behaviour!r}")
    where = f"{behaviour.__module__}.{behaviour.__qualname__}"
    ports: list[Port[Any]] = []
    enums: dict[str, type[enum.Enum]] = {}
    for name, parameter, kind in _arguments(where, behaviour):
        if isinstance(kind, type) and issubclass(kind, enum.Enum):
            enums[name] = kind
        ports.append(_port(where, name, parameter, kind))
    body = {
        "__doc__": behaviour.__doc__,
        "__module__": behaviour.__module__,
        "__qualname__": behaviour.__qualname__,
        "node_id": behaviour.__name__,
        "ports": tuple(ports),
        "behaviour_class": behaviour,
        "enums": enums,
    }
    return type(behaviour.__name__, (ForeignLeaf,), body)


def _arguments(
    where: str, behaviour: type[Behaviour]
) -> Iterator[tuple[str, inspect.Parameter, Any]]:
    try:
        hints = get_type_hints(behaviour.__init__)
    except NameError as error:
        raise InputError(f"{where}: an annotation of its constructor: {error}") from error
    skipped = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    for name, parameter in inspect.signature(behaviour).parameters.items():
        if name == "name" or parameter.kind in skipped:
            continue
        if name not in hints:
            raise InputError(
                f"{where}: argument '{name}' of its constructor has no annotation; {_EXPECTED}"
            )
        yield name, parameter, hints[name]


def _port(where: str, name: str, parameter: inspect.Parameter, kind: Any) -> _ConstructorPort:
    default = Port.REQUIRED if parameter.default is inspect.Parameter.empty else parameter.default
    choices: tuple[str, ...] = ()
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        choices, default = tuple(kind.__members__), getattr(default, "name", default)
        kind = str
    if kind not in _TYPES:
        raise InputError(
            f"{where}: argument '{name}' of its constructor has a type that no port has: {kind}; "
            f"{_EXPECTED}"
        )
    try:
        return _ConstructorPort(name, kind, default, choices=choices)
    except ValueError as error:
        raise InputError(f"{where}: argument '{name}' of its constructor: {error}") from error
