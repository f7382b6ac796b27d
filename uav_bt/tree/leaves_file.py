"""Leaves, policies and drones from a Python file that a user names: parts without a package."""

from __future__ import annotations

import inspect
import sys
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from py_trees.behaviour import Behaviour

from uav_bt import plugins
from uav_bt.errors import FileError
from uav_bt.files import did_you_mean_file
from uav_bt.plugins import describe_failure
from uav_bt.tree.node import Node
from uav_bt.tree.registry import NodeRegistry

WHICH_LEAVES: Final = (
    "A Python file with leaves, policies and drones, known by their class names. Repeatable."
)
LEAVES_FLAG: Final = "--leaves"


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
        raise FileError(file, f"cannot be run: {describe_failure(error)}") from error
    return module
