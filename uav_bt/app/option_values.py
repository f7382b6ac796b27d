"""Types and checks of options, for Python and the command line.

Errors name the expected and the given value.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from numbers import Integral
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Final, NoReturn

from annotated_types import Ge, Gt
from pydantic import BeforeValidator, GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from uav_bt.errors import FileError, InputError, ValueRangeError
from uav_bt.files import reading
from uav_bt.mission.judge import JudgeConfig
from uav_bt.option import Option, option_of, pairs
from uav_bt.protocols import Drone, LeafPolicy
from uav_bt.testing.faults import RANDOM, Fault
from uav_bt.tree.loading.parameters import Plain, split_port
from uav_bt.tree.port import port_text

_ABSENT: Final = object()


def class_name(value: object) -> str:
    """Return the full name of an object's class."""
    return f"{type(value).__module__}.{type(value).__qualname__}"


def is_drone_config(drone: object) -> bool:
    """Return whether an object is a drone's configuration, not a drone."""
    return callable(getattr(drone, "create", None))


def as_file(name: str, value: object, expected: str = "a file") -> Path | None:
    """Return a file's path, None for None; refuse what is neither text nor path."""
    if value is None or isinstance(value, Path):
        return value
    if not isinstance(value, str) or not value:
        refuse(name, f"{expected}, as str or Path", value)
    return Path(value)


def files(value: object) -> tuple[Path, ...]:
    """Return the paths of a list of files of leaves."""
    if not isinstance(value, (tuple, list)):
        refuse("leaves", "a list of files, such as ['my_leaves.py']", value)
    return tuple(path for each in value if (path := as_file("leaves", each or "")) is not None)


def fault_texts(faults: object) -> tuple[str, ...]:
    """Return faults as texts; `@FILE` stands for the lines of a file, which are checked here."""
    if not isinstance(faults, (tuple, list)) or not all(isinstance(one, str) for one in faults):
        refuse(
            "faults",
            "a list of faults as texts, such as ['video-lost@explore+1~3'] (a Fault, also of your "
            "own FaultKind, flies with drone=FaultyDrone(drone, fault))",
            faults,
        )
    return tuple(text for one in faults for text in _fault_lines(one))


def _fault_lines(text: str) -> Iterator[str]:
    if not text.startswith("@"):
        yield text
        return
    path = Path(text[1:])
    with reading(path):
        lines = path.read_text(encoding="utf-8").splitlines()
    for number, line in enumerate(lines, start=1):
        fault = line.strip()
        if fault and fault != RANDOM:
            try:
                Fault.parse(fault)
            except InputError as error:
                raise FileError(path, str(error), line=number) from error
        if fault:
            yield fault


def port_values(ports: object) -> dict[str, str]:
    """Return values of nodes' ports, by NODE.PORT, as the texts of a tree file."""
    expected = "values by node and port, such as {'ExploreFor.min_gain': 0.01}"
    found = _plain_values("ports", expected, ports)
    for name in found:
        try:
            split_port(name)
        except ValueRangeError:
            refuse("ports", expected, name)
    return {name: port_text(value) for name, value in found.items()}


def variable_values(variables: object) -> dict[str, Plain]:
    """Return first values of variables, by name."""
    return _plain_values("variables", "values by variable, such as {'laps': 3}", variables)


def _plain_values(what: str, expected: str, values: object) -> dict[str, Plain]:
    if not isinstance(values, Mapping):
        refuse(what, expected, values)
    for name, value in values.items():
        if not isinstance(name, str):
            refuse(what, expected, name)
        if not isinstance(value, Plain):
            refuse(f"{what}['{name}']", "a text, a number, True or False", value)
    return dict(values)


def check_policies(policies: Any) -> Any:
    """Return leaf policies by node; refuse other values, and policies without `decide`."""
    if not isinstance(policies, Mapping):
        refuse("policies", "policies by node, such as {'Explore': 'corridor'}", policies)
    for node, policy in policies.items():
        expect("policies", node, str, "the name or path of a node")
        usable = isinstance(policy, LeafPolicy) and not isinstance(policy, type)
        if not usable and not isinstance(policy, str):
            refuse(f"policies['{node}']", "a policy's name, or an object with `decide`", policy)
    return policies


def check_drone(drone: Any) -> Any:
    """Return a drone's name, a configuration or a drone; refuse any other value."""
    expected = "a drone's name, a configuration with `create`, or a Drone"
    if not drone or isinstance(drone, type):
        refuse("drone", expected, drone)
    if not isinstance(drone, str) and not is_drone_config(drone):
        refuse_incomplete(drone, expected)
    return drone


def common_seed(drone: object, seed: int) -> int:
    """Return the seed of a flight: its own, or that of its drone's configuration."""
    own = getattr(drone, "seed", 0) if is_drone_config(drone) else 0
    if own and seed and own != seed:
        raise InputError(
            f"seed: expected one seed, got {seed} for the flight and {own} in the drone's "
            f"{type(drone).__name__}: leave out the drone's"
        )
    return own or seed


def refuse_incomplete(drone: object, expected: str = "a Drone") -> None:
    """Refuse a drone that lacks members of the protocol; the message lists them."""
    # Nothing is read: unconnected drones raise.
    missing = [
        name
        for name in vars(Drone)
        if not name.startswith("_") and inspect.getattr_static(drone, name, _ABSENT) is _ABSENT
    ]
    if missing:
        remedy = ": add `airframe = uav_bt.types.Airframe()`" if missing == ["airframe"] else ""
        raise InputError(
            f"drone: expected {expected}; {class_name(drone)} lacks {', '.join(missing)}{remedy}"
        )


def refuse_unusable(
    options: Any,
    drone: str,
    usable: Collection[str],
    *,
    remedy: str = "leave it out, as this drone has no such setting",
) -> None:
    """Refuse options that a drone does not support; defaults are never refused.

    Args:
        options: A `FlightOptions`. The flag of an option is named, too, if the drone is, as a
            command may have given both.
        drone: Subject of the message.
        usable: Names of the options that the drone supports.
        remedy: End of the message: what to do.
    """
    for each in fields(options):
        value, about = getattr(options, each.name), option_of(type(options), each.name)
        if about.of_drone and each.name not in usable and value != each.default:
            is_named = isinstance(options.drone, str)
            name = f"{about.flag_of(each.name)} ({each.name} in Python)" if is_named else each.name
            raise InputError(f"{drone} takes no {name}, got {value!r}: {remedy}")


def expect(name: str, value: object, kind: type | UnionType, expected: str) -> None:
    """Refuse a value of another type."""
    if not isinstance(value, kind):
        refuse(name, expected, value)


def refuse(name: str, expected: str, value: object) -> NoReturn:
    """Raise an InputError that names the expected and the given value."""
    got = f"{value!r:.80}"
    if isinstance(value, type):
        got = f"the class {value.__name__}: write {value.__name__}(...)"
    raise InputError(f"{name}: expected {expected}, got {got}")


MISSION: Final = "Mission"
OUTPUTS: Final = "Outputs"
ROOM: Final = "Simulated room"
REAL: Final = "Real drone"
"""Headings of the help of `uav-bt fly`."""
RECORD_SUFFIX: Final = ".mcap"


@dataclass(frozen=True)
class Checked:
    """A function of the option's name and value checks it, whatever its type, and returns it."""

    check: Callable[[str, Any], Any]

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        del source
        name = str(handler.field_name)
        return core_schema.no_info_plain_validator_function(lambda value: self.check(name, value))


def record_file(name: str, value: object) -> Path | None:
    """Return the path of a record."""
    path = as_file(name, value)
    if path is not None and path.suffix.lower() != RECORD_SUFFIX:
        refuse(name, f"a file whose name ends in {RECORD_SUFFIX}", str(path))
    return path


def scene_text(name: str, value: object) -> str | None:
    """Return a scene's name or path as it was given."""
    expected = "the name or file of a scene (a Scene belongs to the drone, as PlainConfig(scene=))"
    return None if as_file(name, value, expected) is None else str(value)


def loaded(kind: type, load: Callable[[Any], Any], expected: str) -> Checked:
    """Return a check that takes an object, and loads that of a file or a name."""

    def check(name: str, value: object) -> Any:
        if value is None or isinstance(value, kind):
            return value
        as_file(name, value, expected)
        return load(value)

    return Checked(check)


def whole(value: object) -> object:
    """Return an integer of NumPy as `int`; others are checked after this."""
    return int(value) if isinstance(value, Integral) and not isinstance(value, bool) else value


def _size(value: object) -> object:
    sides = tuple(value) if isinstance(value, Iterable) else ()
    if len(sides) != 2:
        refuse("image_size_px", "width and height in pixels, such as (640, 360)", value)
    return tuple(whole(side) for side in sides)


def _size_of_text(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"([1-9]\d{0,4})[xX]([1-9]\d{0,4})", text)
    if match is None:
        raise InputError(f"expected a size such as 640x360, got '{text}'")
    return int(match[1]), int(match[2])


def _policies_of_texts(texts: Iterable[str]) -> dict[str, str]:
    # The last sign counts: a path of a tree may hold others.
    found = pairs(texts, "node", "NODE=NAME, such as Explore=segmentation", last=True)
    for node, policy in found.items():
        if not policy:
            raise InputError(f"expected NODE=NAME, such as Explore=segmentation, got '{node}='")
    return found


def judge_of(
    *,
    judge: Annotated[
        float | None,
        Gt(0),
        Option(
            "End the flight as a timeout this long after the take-off command. Default: as the "
            "mission's Rules say, else 300 s.",
            "--time-limit SECONDS",
            "Mission",
        ),
    ] = None,
) -> JudgeConfig:
    """Return the rules of a flight from their option."""
    return JudgeConfig(time_limit_s=judge)


Seed = Annotated[
    int,
    BeforeValidator(whole),
    Ge(0),
    Option("Seed of everything random.", "", ROOM, of_drone=True),
]
Policies = Annotated[
    Mapping[str, str | LeafPolicy],
    Checked(lambda _, value: check_policies(value)),
    Option(
        "Let a node, by name or path, use another leaf policy. Repeatable.",
        "--policy NODE=NAME",
        MISSION,
        read=_policies_of_texts,
    ),
]
Profile = Annotated[
    str,
    Option(
        "How imperfect the twin is: ideal, lab or harsh; lab-instant and harsh-instant have "
        "telemetry without delay.",
        "NAME",
        ROOM,
        of_drone=True,
    ),
]
ImageSize = Annotated[
    tuple[Annotated[int, Ge(1)], Annotated[int, Ge(1)]],
    BeforeValidator(_size),
    Option(
        "Size of the camera's frames, 16:9.",
        "--image-size WxH",
        ROOM,
        of_drone=True,
        read=_size_of_text,
        write="{0[0]}x{0[1]}".format,
    ),
]
Threads = Annotated[
    int,
    BeforeValidator(whole),
    Ge(1),
    Option(
        "Threads of the networks' inference. With one, a flight does not depend on the machine's "
        "load.",
        "--threads",
        "Options",
    ),
]
