"""What some flights hold, counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from uav_bt.learning.dataset.commands import MOVEMENT_KINDS
from uav_bt.learning.dataset.flight_data import FlightData

__all__ = ["DatasetSummary", "summarise"]


@dataclass(frozen=True, kw_only=True)
class DatasetSummary:
    """Counts over all flights; mappings are by name, the most frequent first."""

    flights: int
    frames: int
    hours: float
    ticks: int
    scenes: dict[str, int]  # flights in each
    outcomes: dict[str, int]  # flights that ended so
    commands: dict[str, int]  # ticks in which a movement of that kind was sent
    cameras: int  # different ones: one data set takes the flights of one
    picture_bytes: int  # of all frames at their full size, decoded


def summarise(flights: Sequence[FlightData]) -> DatasetSummary:
    """Return the counts of some flights."""
    commands: Counter[str] = Counter()
    for flight in flights:
        commands.update(MOVEMENT_KINDS[kind] for kind in flight.kinds)
    return DatasetSummary(
        flights=len(flights),
        frames=sum(len(flight) for flight in flights),
        hours=sum(flight.duration_s for flight in flights) / 3600.0,
        ticks=sum(len(flight.tick_s) for flight in flights),
        scenes=_counted([flight.scene or "unknown" for flight in flights]),
        outcomes=_counted([flight.outcome or "unknown" for flight in flights]),
        commands=dict(commands.most_common()),
        cameras=len({flight.camera for flight in flights}),
        picture_bytes=sum(
            3 * flight.camera.width_px * flight.camera.height_px * len(flight) for flight in flights
        ),
    )


def _counted(names: Sequence[str]) -> dict[str, int]:
    return dict(Counter(names).most_common())
