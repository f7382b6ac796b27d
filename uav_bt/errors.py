"""All errors of the project.

UavBtError                      exit code 1 unless a subclass states another
  InputError                    the input was refused (exit code 2)
    ShapeError                    an array has the wrong shape
    ValueRangeError               a number is out of its range
    FileError                     a file is missing, malformed or damaged (file and line)
      SceneError                    a scene file
      WeightsError                  a weights file
        AnswerError                   the answer of a network to one frame
      TreeError                     a tree file; carries every finding of the file
    UnknownNameError              a name that is not registered, with a suggestion
    MissingDependencyError        a package or a system library is absent, with the remedy
  MissionError                  an error inside the mission
    ProposalConflictError         two leaves proposed on one channel in one tick
    BoardAccessError              undeclared or mistyped access to the board
      UnknownValueError             a board key without a fresh value, where a node needs one
    PolicyFailedError             an exception in a leaf policy, with its author's line
    NodeFailedError               an exception in a node, with the node's path
  DroneError                    the drone did not carry out a command
"""

from __future__ import annotations

import difflib
import traceback
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import ClassVar, Final


def did_you_mean(name: str, known: Iterable[str], *, cutoff: float = 0.6, suffix: str = "") -> str:
    """Return ``"; did you mean 'x'?"`` for the closest known name, or an empty string.

    `cutoff` is the smallest similarity, 0 to 1, as `difflib` measures it; `suffix` is added.
    """
    close = difflib.get_close_matches(name, list(known), n=1, cutoff=cutoff)
    return f"; did you mean '{close[0]}{suffix}'?" if close else ""


class UavBtError(Exception):
    """Base class of the project's errors."""

    exit_code: ClassVar[int] = 1


class InputError(UavBtError):
    """The input cannot be used."""

    exit_code: ClassVar[int] = 2


class ShapeError(InputError):
    """An array has the wrong shape."""

    def __init__(self, name: str, *, expected: str, actual: Sequence[int]) -> None:
        got = "x".join(str(size) for size in actual)
        super().__init__(f"{name} must be {expected}, got {got}")


class ValueRangeError(InputError, ValueError):
    """A number is out of its range."""


class FileError(InputError):
    """A file is missing, malformed or damaged."""

    def __init__(self, path: Path | str, message: str, line: int | None = None) -> None:
        super().__init__(path, message, line)  # of which another process makes it again
        self.path = Path(path)
        self.line = line
        where = f"{path}:{line}" if line is not None else str(path)
        self._text = f"{where}: {message}"

    def __str__(self) -> str:
        return self._text


class SceneError(FileError):
    """A scene file cannot be flown."""


class WeightsError(FileError):
    """A weights file is absent, damaged or made for another network."""


class AnswerError(WeightsError):
    """The answer of a network to one frame cannot be used, such as NaN."""


class TreeError(FileError):
    """A tree file was refused; `findings` are the lines of the report, `details` their values."""

    def __init__(self, path: Path | str, findings: Sequence[object]) -> None:
        self.details = tuple(findings)
        self.findings = tuple(str(finding) for finding in findings)
        count = len(self.findings)
        head = f"refused, {count} error{'s' if count != 1 else ''}"
        super().__init__(path, "\n  ".join([head, *self.findings]))
        self.args = (path, self.details)


class UnknownNameError(InputError, ValueError):
    """A name that is not registered."""

    def __init__(self, kind: str, name: str, known: Iterable[str], where: str = "") -> None:
        names = sorted(known)
        super().__init__(
            f"unknown {kind} '{name}'{did_you_mean(name, names)} "
            f"({where or 'known'}: {', '.join(names) if names else 'none'})"
        )


class MissingDependencyError(InputError):
    """A package or a system library is absent."""


class MissionError(UavBtError):
    """An error inside the mission."""


class ProposalConflictError(MissionError):
    """Two leaves proposed on one channel in one tick."""


class BoardAccessError(MissionError):
    """Undeclared or mistyped access to the board."""


class UnknownValueError(BoardAccessError):
    """A script or port reads a board key that has no fresh value; the node that reads it fails."""


class PolicyFailedError(MissionError):
    """A leaf policy raised; the message has file and line of its code."""

    def __init__(self, policy: object, cause: Exception) -> None:
        kind = type(policy)
        super().__init__(
            f"policy {kind.__qualname__}: {type(cause).__name__}: {cause}{_line_of(cause, kind)}"
        )


class NodeFailedError(MissionError):
    """An exception in a node of the tree.

    The message has the innermost line of the package of its class, the author's, or of the nearest
    base class that the exception passed through.
    """

    def __init__(self, node_path: str, cause: BaseException, author: type | None = None) -> None:
        self.node_path = node_path
        has_line = isinstance(cause, PolicyFailedError)  # its message has the line
        line = "" if author is None or has_line else _line_of(cause, author)
        super().__init__(f"node '{node_path}' failed: {type(cause).__name__}: {cause}{line}")


def _line_of(cause: BaseException, author: type) -> str:
    """Return ` (file:line)` for the innermost line of a class's package, else an empty text."""
    frames = list(traceback.walk_tb(cause.__traceback__))
    for base in (each for each in author.__mro__ if not each.__module__.startswith(_ENGINES)):
        package = base.__module__.partition(".")[0]
        for frame, line in reversed(frames):
            module = str(frame.f_globals.get("__name__"))
            if module.partition(".")[0] == package and not module.startswith(_ENGINES):
                file = Path(frame.f_code.co_filename)
                parts = module.count(".") + 1 + (file.name == "__init__.py")
                return f" ({Path(*file.parts[-parts:])}:{line})"
    return ""


_ENGINES: Final = ("uav_bt.tree.", "py_trees.")  # these run leaves and contain none


class DroneError(UavBtError):
    """The drone did not carry out a command."""
