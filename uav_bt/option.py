"""Declarations of options: they stand in the `Annotated` type of a field or a parameter.

    seed: Annotated[int, Ge(0), Option("Seed of everything random.")] = 0

The command line (`uav_bt/cli/declare.py`) makes its options from them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cache
from typing import Any, Literal, get_type_hints

from uav_bt.errors import InputError


@dataclass(frozen=True)
class Option:
    """What an option is for, and how the command line writes it.

    Attributes:
        help: One or two sentences.
        form: Flag and placeholder of the value, as `--set NODE.PORT=VALUE`. Default flag: the name
            of the field or parameter.
        group: Heading in the help; fields of `FlightOptions` without one are for Python only.
        of_drone: Whether a drone's configuration has a field with the name of this option.
        path: What a path is: a file that is read or written, or a folder that is written.
        suffix: How the name of a written file ends.
        alone: The text when the flag stands alone. None: the flag needs a value.
        read: Makes the value from the text, or from all texts of a repeated option.
        write: Makes the text of a default.
        parts: A function that makes the value; each of its parameters becomes an option.
        only: The parameters of `parts` that become options; empty: all.
        defaults: Defaults in place of those of the parameters of `parts`.
    """

    help: str = ""
    form: str = ""
    group: str = ""
    _: KW_ONLY
    of_drone: bool = False
    path: Literal["", "read", "written", "folder"] = ""
    suffix: str = ""
    alone: str | None = None
    read: Callable[[Any], Any] | None = None
    write: Callable[[Any], str] | None = None
    parts: Callable[..., Any] | None = None
    only: tuple[str, ...] = ()
    defaults: Mapping[str, Any] = field(default_factory=dict)

    def flag_of(self, name: str) -> str:
        """Return the flag of a field or parameter with this declaration."""
        flag = self.form.partition(" ")[0]
        return flag if flag.startswith("--") else f"--{name.replace('_', '-')}"

    @property
    def metavar(self) -> str | None:
        """The placeholder of the value; None: as its type has it."""
        flag, space, rest = self.form.partition(" ")
        return (rest if flag.startswith("--") else f"{flag}{space}{rest}") or None


def option_of(made: Any, name: str) -> Option:
    """Return the declaration of a field; its help may be its docstring."""
    about = next(each for each in _hints(made)[name].__metadata__ if isinstance(each, Option))
    return about if about.help else replace(about, help=text_below(made, name))


def text_below(made: Any, name: str) -> str:
    """Return the docstring of a field in one line, "" without one."""
    known = getattr(made, "__pydantic_fields__", {}).get(name)
    return " ".join(str(known.description or "").split()) if known else ""


@cache
def _hints(made: type) -> dict[str, Any]:
    return get_type_hints(made, include_extras=True)


def pairs(texts: Iterable[str], what: str, form: str, *, last: bool = False) -> dict[str, str]:
    """Return several NAME=VALUE as a mapping, parted at the first `=` or the last.

    Raises:
        InputError: One has no name or no `=`, or two have one name.
    """
    found: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.rpartition("=") if last else text.partition("=")
        if not (name and equals):
            raise InputError(f"expected {form}, got '{text}'")
        if name in found:
            raise InputError(f"{what} '{name}' is given two values")
        found[name] = value
    return found
