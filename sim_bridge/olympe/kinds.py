"""Configurations of Olympe's drones that the entry points register."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.olympe.drone import OlympeDrone


@dataclass(frozen=True, kw_only=True)
class _DroneConfig(OlympeConfig):
    def create(self) -> OlympeDrone:
        """Return a bridge to the drone. Its `connect` opens the connection."""
        return OlympeDrone(self)


@dataclass(frozen=True, kw_only=True)
class AnafiConfig(_DroneConfig):
    """A real ANAFI, over its Wi-Fi or through its remote control; see `OlympeConfig`."""

    kind: ClassVar[str] = "anafi"
    default_host: ClassVar[str] = "192.168.42.1"


@dataclass(frozen=True, kw_only=True)
class SphinxConfig(_DroneConfig):
    """An ANAFI simulated by Sphinx, at the address of its first drone; see `OlympeConfig`."""

    kind: ClassVar[str] = "sphinx"
    default_host: ClassVar[str] = "10.202.0.1"
