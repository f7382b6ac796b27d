"""Checks of values that users hand over in Python; errors name the expected and the given value."""

from __future__ import annotations

import inspect
from collections.abc import Collection, Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from types import UnionType
from typing import Any, Final, NoReturn

from uav_bt.errors import FileError, InputError, ValueRangeError
from uav_bt.files import reading
from uav_bt.option import option_of
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
