"""Parrot's ANAFI, flown through the Olympe SDK: a real one, or a simulated one of Sphinx.

The SDK is not imported before a drone connects, and only `sdk` imports it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from uav_bt.protocols import DroneOptions

if TYPE_CHECKING:
    from sim_bridge.olympe.drone import OlympeDrone

__all__ = ["create_anafi", "create_sphinx"]


def create_anafi(options: DroneOptions) -> OlympeDrone:
    """Make a bridge to an ANAFI; nothing is sent before its `connect`.

    Args:
        options: address (the drone's own network when None), ports, limits, image size.

    Raises:
        InputError: the address or a limit cannot be used.
    """
    return _create("anafi", options)


def create_sphinx(options: DroneOptions) -> OlympeDrone:
    """Make a bridge to an ANAFI simulated by Sphinx; nothing is sent before its `connect`.

    Args:
        options: address (where Sphinx puts its drone when None), ports, limits, image size.

    Raises:
        InputError: the address or a limit cannot be used.
    """
    return _create("sphinx", options)


def _create(kind: str, options: DroneOptions) -> OlympeDrone:
    from sim_bridge.olympe.config import olympe_config  # noqa: PLC0415  (heavy imports wait)
    from sim_bridge.olympe.drone import OlympeDrone  # noqa: PLC0415  (heavy imports wait)

    return OlympeDrone(olympe_config(kind, options))
