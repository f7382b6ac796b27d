"""Types and checks of options, for Python and the command line.

Errors name the expected and the given value.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from numbers import Integral
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Final, NoReturn

from annotated_types import Ge, MinLen
from pydantic import AfterValidator, BeforeValidator, Field, GetPydanticSchema
from pydantic_core import core_schema

from uav_bt.errors import FileError, InputError
from uav_bt.files import reading
from uav_bt.option import Option, option_of, pairs
from uav_bt.protocols import Drone, LeafPolicy
from uav_bt.testing.faults import RANDOM, Fault
from uav_bt.tree.loading.parameters import Plain
from uav_bt.tree.port import port_text

_ABSENT: Final = object()


def checked_by(check: Callable[[Any], Any]) -> GetPydanticSchema:
    """Let a function check a value, whatever its type, and return it."""
    schema = core_schema.no_info_plain_validator_function(check)
    return GetPydanticSchema(lambda *_: schema)


def class_name(value: object) -> str:
    """Return the full name of an object's class."""
    return f"{type(value).__module__}.{type(value).__qualname__}"


def is_drone_config(drone: object) -> bool:
    """Return whether an object is a drone's configuration, not a drone."""
    return callable(getattr(drone, "create", None))


def expect(name: str, value: object, kind: type | UnionType, expected: str) -> None:
    """Refuse a value of another type, and a class in place of an object."""
    if isinstance(value, type) or not isinstance(value, kind):
        refuse(name, expected, value)


def refuse(name: str, expected: str, value: object) -> NoReturn:
    """Raise an InputError that names the expected and the given value."""
    got = f"{value!r:.80}"
    if isinstance(value, type):
        got = f"the class {value.__name__}: write {value.__name__}(...)"
    raise InputError(f"{name}: expected {expected}, got {got}")


def as_file(name: str, value: str | Path | None, expected: str = "a file") -> Path | None:
    """Return a file's path, None for None; refuse what is neither text nor path."""
    if value == "" or not isinstance(value, str | Path | None):
        refuse(name, f"{expected}, as str or Path", value)
    return None if value is None else Path(value)


def fault_texts(faults: Sequence[str]) -> tuple[str, ...]:
    """Return faults as texts; `@FILE` stands for the lines of a file."""
    found: list[str] = []
    for text in faults:
        found += _fault_lines(Path(text[1:])) if text.startswith("@") else [text]
    return tuple(found)


def _fault_lines(path: Path) -> Iterator[str]:
    with reading(path):
        lines = path.read_text(encoding="utf-8").splitlines()
    for number, line in enumerate(lines, start=1):
        fault = line.strip()
        try:
            if fault not in {"", RANDOM}:
                Fault.parse(fault)
        except InputError as error:
            raise FileError(path, str(error), line=number) from error
        if fault:
            yield fault


def _mapping_of(
    what: str, expected: str, each: tuple[Any, str], made: Callable[[Any], Any] = lambda one: one
) -> GetPydanticSchema:
    """Return a check of a mapping; `each` is the type of its values, in words, too."""

    def checked(given: Any) -> dict[str, Any]:
        expect(what, given, Mapping, expected)
        for name, value in given.items():
            expect(what, name, str, expected)
            expect(f"{what}['{name}']", value, *each)
        return {name: made(value) for name, value in given.items()}

    return checked_by(checked)


def check_drone(drone: Any) -> Any:
    """Return a drone's name, a configuration or a drone; refuse any other value."""
    expected = "a drone's name, a configuration with `create`, or a Drone"
    if not drone or isinstance(drone, type):
        refuse("drone", expected, drone)
    if not isinstance(drone, str) and not is_drone_config(drone):
        refuse_incomplete(drone, expected)
    return drone


def refuse_incomplete(drone: object, expected: str = "a Drone") -> None:
    """Refuse a drone that lacks members of the protocol; the message lists them."""
    # Nothing is read: unconnected drones raise.
    names = [name for name in vars(Drone) if not name.startswith("_")]
    missing = [name for name in names if inspect.getattr_static(drone, name, _ABSENT) is _ABSENT]
    if missing:
        raise InputError(
            f"drone: expected {expected}; {class_name(drone)} lacks {', '.join(missing)}"
        )


def refuse_unusable(options: Any, drone: str, usable: Collection[str], cure: str) -> None:
    """Refuse the `FlightOptions` that a drone does not support; defaults are never refused.

    The message begins with `drone`, ends with `cure`, and names the flag of a named drone.
    """
    for each in fields(options):
        value, about = getattr(options, each.name), option_of(type(options), each.name)
        if about.of_drone and each.name not in usable and value != each.default:
            is_named = isinstance(options.drone, str)
            name = f"{about.flag_of(each.name)} ({each.name} in Python)" if is_named else each.name
            raise InputError(f"{drone} takes no {name}, got {value!r}: {cure}")


def _whole(value: object) -> object:
    return int(value) if isinstance(value, Integral) and not isinstance(value, bool) else value


def _size_of_text(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"([1-9]\d{0,4})[xX]([1-9]\d{0,4})", text)
    if match is None:
        raise InputError(f"expected a size such as 640x360, got '{text}'")
    return int(match[1]), int(match[2])


def _policies_of_texts(texts: Iterable[str]) -> dict[str, str]:
    # The last sign counts: a path of a tree may hold others.
    return pairs(texts, "node", "NODE=NAME, such as Explore=segmentation", last=True)


def loaded_by(load: Callable[[str | Path], Any], kind: type) -> GetPydanticSchema:
    """Return a check that loads the object of a file or a name; objects stay."""

    def loaded(given: object) -> object:
        if isinstance(given, str | Path):
            return load(given)
        expect(kind.__name__, given, kind | None, f"a {kind.__name__}, its file or its name")
        return given

    return checked_by(loaded)


_POLICY: Final = (str | LeafPolicy, "a policy's name, or an object with `decide`")
_PLAIN: Final = (Plain, "a text, a number, True or False")
PORTS: Final = _mapping_of(
    "ports", "values by node and port, such as {'TakeOff.height_m': 1.2}", _PLAIN, port_text
)
VARIABLES: Final = _mapping_of("variables", "values by variable, such as {'laps': 3}", _PLAIN)
Whole = Annotated[int, BeforeValidator(_whole)]
"""Also an integer of NumPy."""
File = Annotated[
    Annotated[str, MinLen(1)] | Path | None,
    AfterValidator(lambda file: None if file is None else Path(file)),
]
Seed = Annotated[
    Whole, Ge(0), Option("Seed of everything random.", "", "Simulated room", of_drone=True)
]
Policies = Annotated[
    Mapping[str, str | LeafPolicy],
    _mapping_of("policies", "policies by node, such as {'Explore': 'corridor'}", _POLICY),
    Option(
        "Let a node, by name or path, use another leaf policy. Repeatable.",
        "--policy NODE=NAME",
        "Mission",
        read=_policies_of_texts,
    ),
]
Profile = Annotated[
    str,
    Option(
        "How imperfect the twin is: ideal, lab or harsh.",
        "NAME",
        "Simulated room",
        of_drone=True,
    ),
]
ImageSize = Annotated[
    tuple[Annotated[Whole, Ge(1)], Annotated[Whole, Ge(1)]],
    Field(strict=False),  # a list is as good
    Option(
        "Size of the camera's frames, 16:9.",
        "--image-size WxH",
        "Simulated room",
        of_drone=True,
        read=_size_of_text,
        write="{0[0]}x{0[1]}".format,
    ),
]
Threads = Annotated[
    Whole,
    Ge(1),
    Option(
        "Threads of the networks' inference. With one, a flight does not depend on the machine's "
        "load.",
        "--threads",
        "Options",
    ),
]
