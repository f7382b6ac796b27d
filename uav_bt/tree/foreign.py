"""Behaviours of py_trees in our trees: plain ones as leaves, and a tree of theirs as the root."""

from __future__ import annotations

import enum
import inspect
import logging
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, ClassVar, Final, get_type_hints

from py_trees import common, decorators, timers
from py_trees.behaviour import Behaviour

from uav_bt.board.context import MissionContext
from uav_bt.errors import InputError, MissionError, NodeFailedError
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.port import Port, Reference, parse_reference
from uav_bt.tree.status import RUNNING, Status

_log: Final = logging.getLogger(__name__)

_EXPECTED: Final = "annotate it with str, int, float, bool or an enumeration"


class _ConstructorPort(Port[Any]):
    """A constructor argument. It must be a literal, since it is needed before the tree runs."""

    def bind(self, given: object) -> Any | Reference:
        """Return the typed value; a reference is refused."""
        if isinstance(given, str) and parse_reference(given, self.name) is not None:
            raise ValueError(
                f"a py_trees behaviour is constructed before any variable has a value: "
                f"expected a literal, got '{given}'"
            )
        return super().bind(given)


class _Foreign(Node):
    """Ticks a behaviour of py_trees, by the `tick` of py_trees."""

    behaviour: Behaviour
    _active = False  # ticked and still running

    @property
    def author(self) -> type:
        """The class of the behaviour."""
        return type(self.behaviour)

    def update(self) -> Status:
        """Tick the behaviour and return its answer."""
        self._active = True
        for ticked in self.behaviour.tick():
            if not isinstance(ticked, Node) and ticked.status is common.Status.INVALID:
                raise MissionError(
                    f"update() of {type(ticked).__qualname__} must return a status of py_trees, "
                    "got INVALID or another value"  # of which py_trees makes INVALID
                )
        self.feedback_message = self.behaviour.feedback_message
        status = Status[self.behaviour.status.name]
        self._active = status is RUNNING
        return status

    def _stop(self) -> None:
        """Stop the behaviour if it is still running."""
        if self._active:
            self._active = False
            self.behaviour.stop(common.Status.INVALID)

    def _warn_of_wall_clock(self) -> None:
        for behaviour in _foreign(self.behaviour):
            if isinstance(behaviour, (timers.Timer, decorators.Timeout)):
                _log.warning(
                    "Warning: node '%s': '%s' of py_trees measures the computer's clock, not the "
                    "mission's; in a tree file use Sleep, Delay or Timeout",
                    self.path,
                    type(behaviour).__name__,
                )


class ForeignLeaf(_Foreign, Leaf):
    """Ticks an unmodified py_trees behaviour.

    The behaviour is constructed and set up with the tree. Its methods are called in the order that
    py_trees documents. Halting the leaf stops the behaviour with INVALID. A tick that answers
    INVALID, as py_trees does for an answer that is no status, raises.
    """

    behaviour_class: ClassVar[type[Behaviour]]
    enums: ClassVar[dict[str, type[enum.Enum]]]  # enumerations of the constructor, by argument

    def __init__(self, name: str | None = None, /, **given: object) -> None:
        super().__init__(name, **given)
        self._construct()

    def rebind(self, given: Mapping[str, object]) -> None:
        """Replace the values of ports, before the setup, and construct the behaviour again."""
        super().rebind(given)
        self._construct()

    def _construct(self) -> None:
        arguments = dict(self.literals)
        arguments |= {key: kind[arguments[key]] for key, kind in self.enums.items()}
        if "name" in inspect.signature(self.behaviour_class).parameters:
            arguments["name"] = self.name
        try:
            self.behaviour = self.behaviour_class(**arguments)
        except Exception as error:
            raise InputError(
                f"node '{self.name}' ({self.node_id}) cannot be constructed: "
                f"{type(error).__name__}: {error}"
            ) from error

    def on_setup(self, _: MissionContext) -> None:
        """Set the behaviour up."""
        self.behaviour.setup_with_descendants()
        self._warn_of_wall_clock()

    def on_shutdown(self) -> None:
        """Shut down the behaviour and its descendants."""
        for behaviour in self.behaviour.iterate():
            behaviour.shutdown()

    def terminate(self, _: Status) -> None:
        """Stop the behaviour if it is still running."""
        self._stop()


class PyTreesRoot(_Foreign):
    """Ticks a tree of py_trees, in which nodes of ours may stand.

    Composites of py_trees tick by the rules of py_trees. Their behaviours are set up as by
    `BehaviourTree.setup(mission=...)`: `setup(**kwargs)` gets the `MissionContext` as `mission`.
    The children of this node are the nodes of ours, each below the root's path; the behaviours of
    py_trees between them are no nodes and have no events.
    """

    kind = NodeKind.CONTROL
    max_children = None

    def __init__(self, root: Behaviour) -> None:
        if root.parent is not None:
            raise InputError(
                f"behaviour '{root.name}' stands below '{root.parent.name}': give the root of the "
                "tree"
            )
        super().__init__(root.name)
        self.behaviour = root
        self.children = list(_uppermost(root))  # their parents stay those of py_trees
        self._set_up: list[Behaviour] = []

    def _setup(self) -> None:
        for behaviour in _foreign(self.behaviour):
            behaviour.setup(mission=self.mission)
            self._set_up.append(behaviour)
        self._warn_of_wall_clock()

    def shutdown(self) -> None:
        """Shut the behaviours of py_trees down; of several that raise, the first is raised."""
        first: NodeFailedError | None = None
        while self._set_up:
            behaviour = self._set_up.pop(0)
            try:
                behaviour.shutdown()
            except Exception as error:  # noqa: BLE001  (raised below, when all are shut down)
                first = first or NodeFailedError(self.path, error, type(behaviour))
        if first is not None:
            raise first

    def _halt(self) -> None:
        self._stop()
        super()._halt()


def _uppermost(behaviour: Behaviour) -> Iterator[Node]:
    """Yield the nodes of ours that stand directly below behaviours of py_trees."""
    for child in behaviour.children:
        if isinstance(child, Node):
            yield child
        else:
            yield from _uppermost(child)


def _foreign(behaviour: Behaviour) -> Iterator[Behaviour]:
    """Yield the behaviours of py_trees, children first, as py_trees sets them up."""
    return (each for each in behaviour.iterate() if not isinstance(each, Node))


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
    enums: dict[str, type[enum.Enum]] = {}
    ports = tuple(_constructor_ports(behaviour, enums))
    body = {name: getattr(behaviour, name) for name in ("__doc__", "__module__", "__qualname__")}
    body |= {"ports": ports, "behaviour_class": behaviour, "enums": enums}
    return type(behaviour.__name__, (ForeignLeaf,), body)


def _constructor_ports(
    behaviour: type[Behaviour], enums: dict[str, type[enum.Enum]]
) -> Iterator[Port[Any]]:
    """Yield a port for each argument; `enums` gets the enumerations by argument."""
    where = f"{behaviour.__module__}.{behaviour.__qualname__}"
    try:
        hints = get_type_hints(behaviour.__init__)
    except NameError as error:
        raise InputError(f"{where}: an unknown type in its constructor: {error}") from error
    for name, argument in inspect.signature(behaviour).parameters.items():
        if name == "name" or argument.kind in (argument.VAR_POSITIONAL, argument.VAR_KEYWORD):
            continue
        what = f"{where}: argument '{name}' of its constructor"
        if name not in hints:
            raise InputError(f"{what} has no annotation; {_EXPECTED}")
        kind: Any = hints[name]
        default = Port.REQUIRED if argument.default is argument.empty else argument.default
        choices: tuple[str, ...] = ()
        if isinstance(kind, type) and issubclass(kind, enum.Enum):
            enums[name] = kind
            choices, default = tuple(kind.__members__), getattr(default, "name", default)
            kind = str
        if kind not in (str, int, float, bool):
            raise InputError(f"{what} has a type that no port has: {kind}; {_EXPECTED}")
        try:
            yield _ConstructorPort(name, kind, default, choices=choices)
        except ValueError as error:
            raise InputError(f"{what}: {error}") from error
