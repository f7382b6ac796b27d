"""A drone's own photographs, which it stores on a memory card and hands out after the flight.

A drone that has such a camera implements `Photographing` beside `Drone`. Frames of the video are no
such photographs.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Protocol, runtime_checkable


class StillState(enum.Enum):
    """State of a photograph that was asked for."""

    TAKING = "taking"
    SAVED = "saved"
    FAILED = "failed"


@dataclass(frozen=True, kw_only=True)
class Still:
    """A photograph that was asked for."""

    state: StillState = StillState.TAKING
    media: str = ""  # identifier of the saved photograph on the drone; empty before
    reason: str = ""  # why it failed, such as "the memory card is full"; empty otherwise


@runtime_checkable
class StillCamera(Protocol):
    """Takes photographs with the drone's camera; only `fetch_still` waits."""

    def take_still(self) -> int:
        """Ask for a photograph of this moment; return its number."""

    def still(self, number: int) -> Still:
        """Return the present state of a photograph, by its number."""

    def fetch_still(self, media: str, limit_s: float) -> bytes:
        """Return a saved photograph as a JPEG file, within a limit of seconds; else DroneError."""


@runtime_checkable
class Photographing(Protocol):
    """A drone whose camera takes photographs besides the video."""

    @property
    def stills(self) -> StillCamera | None:
        """The camera; None before connecting, and for a drone without a camera."""
