"""Ports that are numbers between two bounds, one line each."""

from __future__ import annotations

from typing import Any

from uav_bt.tree import Port


def number(
    name: str, default: float | None, least: float, most: float, doc: str, **more: Any
) -> Port[float]:
    """Return the port of a number from `least` to `most`; one without a default is required."""
    value = Port.REQUIRED if default is None else default
    return Port(name, float, value, doc, least=least, most=most, **more)
