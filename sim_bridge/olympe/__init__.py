"""Bridge to Parrot's ANAFI through the Olympe SDK: a real drone, or one simulated by Sphinx.

The entry points register `AnafiConfig` and `SphinxConfig`. Only `sdk` imports Parrot's SDK, when a
drone connects.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from sim_bridge.olympe.config import OlympeConfig

if TYPE_CHECKING:
    from sim_bridge.olympe.drone import OlympeDrone

__all__ = ["AnafiConfig", "SphinxConfig"]


@dataclass(frozen=True, kw_only=True)
class AnafiConfig(OlympeConfig):
    """A real ANAFI, over its Wi-Fi or through its remote control; see `OlympeConfig`."""

    kind: ClassVar[str] = "anafi"
    default_host: ClassVar[str] = "192.168.42.1"

    def create(self) -> OlympeDrone:
        """Return a bridge to the drone. Its `connect` opens the connection."""
        from sim_bridge.olympe.drone import OlympeDrone  # noqa: PLC0415  (imports PyAV)

        return OlympeDrone(self)


@dataclass(frozen=True, kw_only=True)
class SphinxConfig(AnafiConfig):
    """An ANAFI simulated by Sphinx, at the address of its first drone; see `OlympeConfig`."""

    kind: ClassVar[str] = "sphinx"
    default_host: ClassVar[str] = "10.202.0.1"
