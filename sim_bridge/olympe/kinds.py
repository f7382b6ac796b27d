"""The kinds of drones that fly through Olympe, as the entry points register them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.olympe.drone import OlympeDrone


@dataclass(frozen=True, kw_only=True)
class _DroneConfig(OlympeConfig):
    def create(self) -> OlympeDrone:
        """Make a bridge to the drone; nothing is sent before its `connect`."""
        return OlympeDrone(self)


@dataclass(frozen=True, kw_only=True)
class AnafiConfig(_DroneConfig):
    """A real ANAFI, on the drone's Wi-Fi or behind its remote control; see `OlympeConfig`."""

    kind: ClassVar[str] = "anafi"
    default_host: ClassVar[str] = "192.168.42.1"


@dataclass(frozen=True, kw_only=True)
class SphinxConfig(_DroneConfig):
    """An ANAFI simulated by Sphinx, where it puts its first drone; see `OlympeConfig`."""

    kind: ClassVar[str] = "sphinx"
    default_host: ClassVar[str] = "10.202.0.1"
