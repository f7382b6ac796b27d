"""Which nodes there are: the format's, those of installed packages and of Python files."""

from __future__ import annotations

import inspect
import logging
import sys
import zlib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import InitVar, dataclass, field, is_dataclass, replace
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any, Final

from py_trees.behaviour import Behaviour

from uav_bt import plugins
from uav_bt.board import MISSION_KEYS
from uav_bt.board.blackboard import Key
from uav_bt.errors import FileError, InputError, UnknownNameError
from uav_bt.files import did_you_mean_file
from uav_bt.option import Option
from uav_bt.tree.foreign import leaf_of
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.node import Node
from uav_bt.tree.nodes import BUILTIN_NODES

_log: Final = logging.getLogger(__name__)


@dataclass(eq=False, kw_only=True)
class NodeRegistry:
    """Node classes by their id: the format's own, and further nodes or py_trees behaviours."""

    nodes: InitVar[Iterable[type[Node | Behaviour]]] = field(default=(), kw_only=False)
    policies: Collection[str] | None = None  # leaf policies that a tree may name; None: any
    factories: Mapping[str, Any] = field(default_factory=dict)  # of policies of no package, by name
    faults: tuple[str, ...] = ()  # of installed packages, whose nodes are missing here
    enum_members: Mapping[str, int] = field(default_factory=dict)  # of a palette, for scripts
    foreign_board: bool = False  # trees of another engine name keys of a board that is not ours

    def __post_init__(self, nodes: Iterable[type[Node | Behaviour]]) -> None:
        self._nodes: dict[str, type[Node]] = {}
        for node in (*BUILTIN_NODES, *nodes):
            self._add(node)

    def __repr__(self) -> str:
        return f"<NodeRegistry: {len(self._nodes)} nodes>"

    @classmethod
    def installed(cls) -> NodeRegistry:
        """Return a registry with the nodes and policies of all installed packages.

        An entry point of the group `uav_bt.behaviours` names an iterable of node classes, or of
        py_trees behaviours. Unusable entries are left out: `faults` has them with the reasons, a
        warning is logged, and a tree file with such a node is refused with the reason. Two packages
        that use one name for different nodes raise an InputError.
        """
        registry = cls(policies=frozenset(plugins.names(plugins.POLICIES)))
        for name in plugins.names(plugins.BEHAVIOURS):
            try:
                nodes = _nodes_of(name)
            except InputError as error:
                registry.faults += (str(error),)
                continue
            for node in nodes:
                try:
                    registry._add(node)
                except InputError as error:
                    if getattr(node, "node_id", None) in registry:
                        raise  # whose node a tree would get is not to be guessed
                    registry.faults += (f"behaviours package '{name}': {error}",)
        for fault in registry.faults:
            _log.warning("Warning: %s", fault)
        return registry

    def with_nodes(self, *nodes: type[Node | Behaviour]) -> NodeRegistry:
        """Return a registry that has further nodes: `NodeRegistry.installed().with_nodes(Peek)`."""
        return replace(self, nodes=(*self._nodes.values(), *nodes))

    def with_policies(self, factories: Mapping[str, Any]) -> NodeRegistry:
        """Return a registry of the same nodes with further policies, or their classes, by name."""
        known = None if self.policies is None else {*self.policies, *factories}
        both = {**self.factories, **factories}
        return replace(self, nodes=self._nodes.values(), policies=known, factories=both)

    def with_any_policy(self) -> NodeRegistry:
        """Return a registry of the same nodes that accepts any policy's name, for benches."""
        return replace(self, nodes=self._nodes.values(), policies=None)

    def _add(self, node: type[Node | Behaviour]) -> None:
        if not (isinstance(node, type) and issubclass(node, Behaviour)):
            raise InputError(f"expected a node class to register, got {node!r}")
        if not issubclass(node, Node):
            node = leaf_of(node)
        known = self._nodes.setdefault(node.node_id, node)
        if known is not node:
            first, second = (f"{one.__module__}.{one.__qualname__}" for one in (known, node))
            raise InputError(
                f"node '{node.node_id}' is registered twice: by {first} and by {second}; set "
                "another node_id on one of them"
            )

    def __getitem__(self, node_id: str) -> type[Node]:
        """Return a node class."""
        if node_id not in self._nodes:
            raise UnknownNameError("node", node_id, self._nodes)
        return self._nodes[node_id]

    def get(self, node_id: str) -> type[Node] | None:
        """Return a node class; None for an unknown id."""
        return self._nodes.get(node_id)

    def __contains__(self, node_id: object) -> bool:
        """Return whether a node of that id is known."""
        return node_id in self._nodes

    def __iter__(self) -> Iterator[str]:
        """Iterate over all ids, in alphabetical order."""
        return iter(sorted(self._nodes))

    @property
    def board_keys(self) -> dict[str, Key[object]]:
        """The mission keys and those that registered leaves declare, by name."""
        keys: dict[str, Key[object]] = {key.name: key for key in MISSION_KEYS}
        for node in self._nodes.values():
            if issubclass(node, Leaf):
                for key in (*node.reads, *node.writes):
                    keys.setdefault(key.name, key)
        return keys


def _nodes_of(name: str) -> tuple[type[Node | Behaviour], ...]:
    """Return what an entry point contributes."""
    loaded = plugins.load(plugins.BEHAVIOURS, name)
    if not isinstance(loaded, Iterable) or isinstance(loaded, str):
        raise InputError(
            f"entry point '{name}' of group '{plugins.BEHAVIOURS}' must name an iterable "
            f"of node classes, got {type(loaded).__name__}"
        )
    return tuple(loaded)


OwnLeaves = Annotated[
    Sequence[str | Path],
    Option(
        "A Python file with leaves, policies and drones, known by their class names. Repeatable.",
        "--leaves FILE.py",
        "Mission",
        path="read",
    ),
]


@dataclass(frozen=True, kw_only=True)
class OwnParts:
    """Classes that Python files define."""

    nodes: tuple[type[Node | Behaviour], ...]  # node classes and plain py_trees behaviours
    policies: Mapping[str, Any]  # classes with `decide`, by name
    drones: Mapping[str, Any]  # configuration dataclasses with `create`, by name


def parts_of_files(files: Sequence[Path]) -> OwnParts:
    """Return the leaves, policies and drones that Python files define.

    A class counts if the file defines it, its name has no leading underscore, and it is not
    abstract. A file is run once in a process, with the rights of this process; a second call
    returns the same classes.
    """
    nodes: list[type[Node | Behaviour]] = []
    policies: dict[str, Any] = {}
    drones: dict[str, Any] = {}
    for file in dict.fromkeys(files):
        before = len(nodes) + len(policies) + len(drones)
        for one in _classes_of(file):
            if issubclass(one, Behaviour):
                nodes.append(one)
                continue
            if callable(getattr(one, "decide", None)):
                _add(file, plugins.POLICIES, one, policies)
            if is_dataclass(one) and callable(getattr(one, "create", None)):
                _add(file, plugins.DRONES, one, drones)
        if len(nodes) + len(policies) + len(drones) == before:
            raise FileError(
                file,
                "defines no leaf, policy or drone: expected a class that inherits "
                "uav_bt.tree.Leaf or a behaviour, a class with `decide`, or a dataclass with "
                "`create`",
            )
    return OwnParts(nodes=tuple(nodes), policies=policies, drones=drones)


def with_leaves(registry: NodeRegistry, files: Sequence[Path]) -> NodeRegistry:
    """Return a registry that has the leaves and policies of Python files, too."""
    own = parts_of_files(files)
    return registry.with_nodes(*own.nodes).with_policies(own.policies) if files else registry


def _classes_of(file: Path) -> Iterator[type]:
    module = _module_of(file)
    for name, value in vars(module).items():
        own = isinstance(value, type) and value.__module__ == module.__name__
        if own and not name.startswith("_") and not inspect.isabstract(value):
            yield value


def _add(file: Path, group: str, one: type, known: dict[str, Any]) -> None:
    name = one.__name__
    if name in known or name in plugins.names(group):
        raise FileError(file, f"'{name}' is taken already: give the class another name")
    known[name] = one


def _module_of(file: Path) -> ModuleType:
    """Run a file as a module; return the module of an earlier run if there is one."""
    path = file.resolve()
    if path.suffix != ".py":
        raise FileError(file, "expected a Python file with leaves, whose name ends in .py")
    if not path.is_file():
        raise FileError(file, f"no such file{did_you_mean_file(path)}")
    name = f"{path.stem}_{zlib.crc32(str(path).encode()):08x}"
    if name in sys.modules:
        return sys.modules[name]
    module = sys.modules[name] = ModuleType(name)  # dataclasses look their module up while it runs
    module.__file__ = str(path)
    try:
        SourceFileLoader(name, str(path)).exec_module(module)
    except (Exception, SystemExit) as error:  # a user's file may raise anything
        del sys.modules[name]
        if isinstance(error, SyntaxError):
            where = error.filename or str(file)
            raise FileError(where, f"is not valid Python: {error.msg}", error.lineno) from error
        raise FileError(file, f"cannot be run: {plugins.describe_failure(error)}") from error
    return module
