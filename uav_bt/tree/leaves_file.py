"""Node classes from a Python file that a user names: leaves without a package."""

from __future__ import annotations

import importlib.util
import inspect
import sys
import zlib
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Final

from py_trees.behaviour import Behaviour

from uav_bt.errors import FileError
from uav_bt.files import did_you_mean_file
from uav_bt.plugins import describe_failure
from uav_bt.tree.node import Node

WHICH_LEAVES: Final = "A Python file with leaves that tree files may use. Repeatable."
LEAVES_FLAG: Final = "--leaves"


def nodes_of_files(files: Sequence[Path]) -> list[type[Node | Behaviour]]:
    """Return the node classes that Python files define, in the order of the files.

    A class counts if the file defines it, its name has no leading underscore, and it is not
    abstract. A file is run once in a process; a second call returns the same classes.

    Args:
        files: Python files. Each is run with the rights of this process.

    Raises:
        FileError: a file does not exist, raises when it is run, or defines no node class.
    """
    return [node for file in files for node in _nodes_of(file)]


def _nodes_of(file: Path) -> list[type[Node | Behaviour]]:
    module = _module_of(file)
    found: list[type[Node | Behaviour]] = [
        value
        for name, value in vars(module).items()
        if isinstance(value, type)
        and issubclass(value, Behaviour)
        and value.__module__ == module.__name__
        and not name.startswith("_")
        and not inspect.isabstract(value)
    ]
    if not found:
        raise FileError(
            file, "defines no leaf: expected a class that inherits uav_bt.tree.Leaf or a behaviour"
        )
    return found


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
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise FileError(file, "cannot be read as a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up while it runs
    try:
        spec.loader.exec_module(module)
    except SyntaxError as error:
        del sys.modules[name]
        where = error.filename or str(file)
        raise FileError(where, f"is not valid Python: {error.msg}", error.lineno) from error
    except (Exception, SystemExit) as error:  # a user's file may raise anything
        del sys.modules[name]
        raise FileError(file, f"cannot be run: {describe_failure(error)}") from error
    return module
