"""Declarations of options: help, flag and checks of an option, stated once for all callers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from uav_bt.app.option_values import as_file, expect, refuse, whole_number


@dataclass(frozen=True, kw_only=True)
class Declared:
    """Declaration of an option, besides its name, type and default.

    Attributes:
        help: One or two sentences.
        flag: The command line's option, with dashes. None: Python only.
        metavar: The command line's placeholder for the value.
        least: Smallest value of a whole number.
        choices: The values that may be given. Empty: any of the type.
        file: Whether the value is a file that is read or written.
        suffix: How the name of a written file ends.
    """

    help: str
    flag: str | None = None
    metavar: str | None = None
    least: int | None = None
    choices: tuple[str, ...] = ()
    file: Literal["read", "written"] | None = None
    suffix: str = ""

    def checked(self, name: str, value: Any, default: object) -> Any:
        """Return a value in its usual type: a number as `int`, a file as `Path`.

        Args:
            name: Name of the option.
            value: Value from the caller.
            default: Default of the option.

        Raises:
            InputError: The declaration does not allow the value.
        """
        if self.file is not None:
            file = as_file(name, value)
            if file is not None and self.suffix and file.suffix.lower() != self.suffix:
                refuse(name, f"a file whose name ends in {self.suffix}", str(file))
            return file
        if self.least is not None:
            return whole_number(name, value, self.least)
        if self.choices and value not in self.choices:
            refuse(name, " or ".join(self.choices), value)
        if isinstance(default, bool):
            expect(name, value, bool, "True or False")
        return value


def about(help_: str, flag: str | None = None, **more: Any) -> dict[str, Declared]:
    """Return a field's metadata: what `Declared` takes."""
    return {"declared": Declared(help=help_, flag=flag, **more)}
