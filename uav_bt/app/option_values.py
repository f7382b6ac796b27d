"""Checks of the values of options; errors name the expected and the given value."""

from __future__ import annotations

import inspect
import operator
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from types import UnionType
from typing import Any, Final, NoReturn

from uav_bt.errors import FileError, InputError, ValueRangeError
from uav_bt.files import reading
from uav_bt.protocols import Drone, LeafPolicy
from uav_bt.testing.faults import RANDOM, Fault
from uav_bt.tree.loading.parameters import Plain, split_port
from uav_bt.tree.port import port_text

_ABSENT: Final = object()
# These options set up the drone.
_OF_THE_DRONE: Final = frozenset(
    {"scene", "seed", "profile", "image_size_px", "realtime", "movers", "vary_room"}
)


def class_name(value: object) -> str:
    """Return the full name of an object's class."""
    return f"{type(value).__module__}.{type(value).__qualname__}"


def is_drone_config(drone: object) -> bool:
    """Return whether an object is a drone's configuration, not a drone."""
    return callable(getattr(drone, "create", None))


def as_file(name: str, value: object, expected: str = "a file") -> Path | None:
    """Return a file's path; None for None.

    Args:
        name: Name of the value in the message.
        value: Value from the caller.
        expected: Description of a valid value.

    Raises:
        InputError: The value is neither text nor path, or it is empty.
    """
    if value is None or isinstance(value, Path):
        return value
    if not isinstance(value, str) or not value:
        refuse(name, f"{expected}, as str or Path", value)
    return Path(value)


def files(value: object) -> tuple[Path, ...]:
    """Return the paths of several files.

    Args:
        value: Sequence of texts and paths.

    Raises:
        InputError: The value is not a sequence of them.
    """
    if not isinstance(value, (tuple, list)):
        refuse("leaves", "a list of files, such as ['my_leaves.py']", value)
    return tuple(path for each in value if (path := as_file("leaves", each or "")) is not None)


def fault_texts(faults: object) -> tuple[str, ...]:
    """Return faults as texts. Those of a file are checked here, where their lines are known.

    Args:
        faults: Sequence of texts. `@FILE` stands for the lines of a file.

    Raises:
        InputError: The value is not such a sequence, or a file cannot be read.
        FileError: A line of a file is not a fault.
    """
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
        if not fault:
            continue
        if fault != RANDOM:
            try:
                Fault.parse(fault)
            except InputError as error:
                raise FileError(path, str(error), line=number) from error
        yield fault


def port_values(ports: object) -> dict[str, str]:
    """Return values of nodes' ports as the texts of a tree file.

    Args:
        ports: Mapping from NODE.PORT to a text, a number or a truth value.

    Raises:
        InputError: The value is not such a mapping.
    """
    expected = "values by node and port, such as {'ExploreFor.min_gain': 0.01}"
    found = _plain_values("ports", expected, ports)
    for name in found:
        try:
            split_port(name)
        except ValueRangeError:
            refuse("ports", expected, name)
    return {name: port_text(value) for name, value in found.items()}


def variable_values(variables: object) -> dict[str, Plain]:
    """Return first values of variables.

    Args:
        variables: Mapping from a variable's name to a text, a number or a truth value.

    Raises:
        InputError: The value is not such a mapping.
    """
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


def check_policies(policies: object) -> None:
    """Refuse a value that is not a mapping from nodes to leaf policies.

    Raises:
        InputError: The value is not a mapping, or a policy lacks `decide`.
    """
    if not isinstance(policies, Mapping):
        refuse("policies", "policies by node, such as {'Explore': 'corridor'}", policies)
    for node, policy in policies.items():
        expect("policies", node, str, "the name or path of a node")
        usable = isinstance(policy, LeafPolicy) and not isinstance(policy, type)
        if not usable and not isinstance(policy, str):
            refuse(f"policies['{node}']", "a policy's name, or an object with `decide`", policy)


def check_drone(drone: object) -> None:
    """Refuse a value that is not a drone's name, a configuration or a drone.

    Raises:
        InputError: The value has another type, or lacks members of the protocol.
    """
    expected = "a drone's name, a configuration with `create`, or a Drone"
    if isinstance(drone, str) and drone:
        return
    if isinstance(drone, str | type):
        refuse("drone", expected, drone)
    if not is_drone_config(drone):
        refuse_incomplete(drone, expected)


def common_seed(drone: object, seed: int) -> int:
    """Return the seed of a flight: its own, or that of the drone's configuration.

    Args:
        drone: A drone's name, a configuration or a drone.
        seed: Seed of the flight; 0 may be the default.

    Raises:
        InputError: Both have a seed, and they differ.
    """
    own = getattr(drone, "seed", 0) if is_drone_config(drone) else 0
    if own and seed and own != seed:
        raise InputError(
            f"seed: expected one seed, got {seed} for the flight and {own} in the drone's "
            f"{type(drone).__name__}: leave out the drone's"
        )
    return own or seed


def refuse_incomplete(drone: object, expected: str = "a Drone") -> None:
    """Refuse a drone that lacks members of the protocol.

    Args:
        drone: Object to check.
        expected: Description of a valid value.

    Raises:
        InputError: The object lacks members; the message lists them.
    """
    missing = list(_missing(Drone, drone))
    if missing:
        remedy = ": add `airframe = uav_bt.types.Airframe()`" if missing == ["airframe"] else ""
        raise InputError(
            f"drone: expected {expected}; {class_name(drone)} lacks {', '.join(missing)}{remedy}"
        )


def _missing(protocol: type, value: object) -> Iterator[str]:
    """Yield the members that an object lacks, without reading them: unconnected drones raise."""
    for name in vars(protocol):
        if not name.startswith("_") and inspect.getattr_static(value, name, _ABSENT) is _ABSENT:
            yield name


def refuse_unusable(
    options: Any,
    drone: str,
    usable: Collection[str],
    *,
    remedy: str = "leave it out, as this drone has no such setting",
) -> None:
    """Refuse options that this drone does not support.

    Args:
        options: A `FlightOptions`. Defaults are never refused. The flag of an option is named, too,
            if the drone is, as a command may have given both.
        drone: Subject of the message.
        usable: Names of the options that the drone supports.
        remedy: End of the message: what to do.

    Raises:
        InputError: The drone does not support an option.
    """
    for each in fields(options):
        value = getattr(options, each.name)
        if each.name in _OF_THE_DRONE.difference(usable) and value != each.default:
            flag = each.metadata["declared"].flag
            is_named = isinstance(options.drone, str)
            name = f"{flag} ({each.name} in Python)" if is_named else each.name
            raise InputError(f"{drone} takes no {name}, got {value!r}: {remedy}")


def whole_number(name: str, value: object, least: int) -> int:
    """Return a whole number as `int`.

    Args:
        name: Name of the value in the message.
        value: An `int` or an integer of NumPy.
        least: Smallest valid value.

    Raises:
        InputError: The value is not a whole number, or it is too small.
    """
    try:
        number = operator.index(value)  # type: ignore[arg-type]  # other types raise TypeError
    except TypeError:
        number = least - 1
    if number < least or isinstance(value, bool):
        refuse(name, f"a whole number from {least}", value)
    return number


def image_size(value: object) -> tuple[int, int]:
    """Return width and height in pixels.

    Raises:
        InputError: The value is not a pair of whole numbers from 1.
    """
    sides = tuple(value) if isinstance(value, Iterable) else ()
    if len(sides) != 2:
        refuse("image_size_px", "width and height in pixels, such as (640, 360)", value)
    width, height = (whole_number("image_size_px", side, 1) for side in sides)
    return width, height


def scene_text(value: object) -> str | None:
    """Return a scene's name or path as it was given; None for None.

    Raises:
        InputError: The value is neither text nor path.
    """
    expected = "the name or file of a scene (a Scene belongs to the drone, as PlainConfig(scene=))"
    return None if as_file("scene", value, expected) is None else str(value)


CHECKED: Final[Mapping[str, Callable[[object], Any]]] = {
    "scene": scene_text,
    "image_size_px": image_size,
    "ports": port_values,
    "variables": variable_values,
    "leaves": files,
    "faults": fault_texts,
}
"""Checks by the option's name; each returns the value in its usual type."""


def expect(name: str, value: object, kind: type | UnionType, expected: str) -> None:
    """Refuse a value of another type.

    Args:
        name: Name of the value in the message.
        value: Value from the caller.
        kind: Expected type.
        expected: Description of a valid value.

    Raises:
        InputError: The value has another type.
    """
    if not isinstance(value, kind):
        refuse(name, expected, value)


def refuse(name: str, expected: str, value: object) -> NoReturn:
    """Refuse a value.

    Args:
        name: Name of the value in the message.
        expected: Description of a valid value.
        value: Value from the caller.

    Raises:
        InputError: Always.
    """
    got = f"{value!r:.80}"
    if isinstance(value, type):
        got = f"the class {value.__name__}: write {value.__name__}(...)"
    raise InputError(f"{name}: expected {expected}, got {got}")
