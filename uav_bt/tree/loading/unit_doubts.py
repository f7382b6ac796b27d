"""Warnings about values that were probably written in another unit than the port's."""

from __future__ import annotations

import math
from typing import Any, Final

from uav_bt.clock import TIME_LIMIT_S
from uav_bt.tree.port import Port

# Users write right angles and their parts in radians, such as 1.047 for 60 degrees.
_STEP_RAD: Final = math.pi / 12
_STEP_SHARE: Final = 0.01  # largest relative distance from a multiple of the step; chosen
_LEAST_MSEC: Final = 10  # a shorter time is less than a tick and probably in seconds; chosen
_TIME_LIMIT: Final = "time_limit_s"  # a port that states the limit is not measured by it


def unit_doubt(port: Port[Any], value: object) -> str | None:
    """Return why a literal was probably written in another unit; None without a doubt.

    Args:
        port: the port; its name has the unit.
        value: the literal as `Port.bind` converts it, in the unit of the port.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    if _has_unit(port, "degrees", "deg"):
        return _radians(value)
    lasts = _has_unit(port, "seconds", "s") and port.name != _TIME_LIMIT
    if lasts and value > TIME_LIMIT_S:
        return (
            f"{value:g} s is longer than a mission, whose time limit is {TIME_LIMIT_S:g} s unless "
            "its Rules or the flight's options raise it"
        )
    if _has_unit(port, "msec", "msec", "ms") and 0 < value < _LEAST_MSEC:
        return f"{value:g} ms is shorter than a tick; for {value:g} s write {1000 * value:g}"
    return None


def _has_unit(port: Port[Any], name: str, *endings: str) -> bool:
    return port.name == name or port.name.endswith(tuple(f"_{ending}" for ending in endings))


def _radians(value: float) -> str | None:
    if not 0.0 < abs(value) <= math.tau or (2 * value).is_integer():
        return None
    steps = round(abs(value) / _STEP_RAD)
    if abs(abs(value) - steps * _STEP_RAD) > _STEP_SHARE * steps * _STEP_RAD:
        return None
    meant_deg = math.copysign(15 * steps, value)
    return f"{value:g} degrees looks like radians; for {meant_deg:g} degrees write {meant_deg:g}"
