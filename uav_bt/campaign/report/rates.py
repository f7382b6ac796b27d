"""Events per hour of flight: contacts, exits from the area, and landings elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from scipy.stats import chi2

from uav_bt.campaign.report.sources import FlightSet
from uav_bt.campaign.report.table import Cell, Table
from uav_bt.mission.judge import Outcome

_PER_H: Final = 100.0  # hours that rates are given for
_HOUR_S: Final = 3600.0
_CONFIDENCE: Final = 0.95


def _landed_elsewhere(flight: Mapping[str, Any]) -> bool:
    if flight["outcome"] not in {Outcome.ABORTED.value, Outcome.TIMEOUT.value}:
        return False
    return flight.get("on_mark") is False


_EVENTS: Final[Mapping[str, Callable[[Mapping[str, Any]], bool]]] = {
    "contacts": lambda flight: flight["outcome"] == Outcome.COLLISION.value,
    "exits": lambda flight: flight["outcome"] == Outcome.LEFT_AREA.value,
    "landings elsewhere": _landed_elsewhere,
}
"""Events that are counted; the first violation ends a flight, so it counts once at most."""


def rate_interval(count: int, hours: float) -> tuple[float, float]:
    """Return the exact 95 % interval of a Poisson rate, events per hour (Garwood, 1936).

    Args:
        count: number of events.
        hours: time in which they occurred, positive.
    """
    tail = (1.0 - _CONFIDENCE) / 2.0
    low = 0.0 if count == 0 else float(chi2.ppf(tail, 2 * count)) / 2.0
    # Without an event the interval has one end only.
    high_tail = 1.0 - _CONFIDENCE if count == 0 else tail
    high = float(chi2.ppf(1.0 - high_tail, 2 * (count + 1))) / 2.0
    return low / hours, high / hours


def rates_of(sets: Sequence[FlightSet]) -> Table:
    """Return the table of events per hour; trees that have not flown are left out."""
    rows: list[tuple[Cell, ...]] = []
    for one in sets:
        hours = sum(flight.get("duration_s") or 0.0 for flight in one.flights) / _HOUR_S
        if hours <= 0.0:
            continue
        path_m = sum(flight.get("total_distance_m") or 0.0 for flight in one.flights)
        covered = sum(flight.get("coverage_passed") or 0.0 for flight in one.flights)
        row: list[Cell] = [
            one.label,
            round(hours, 2),
            round(path_m / hours),
            round(covered / hours, 1),
        ]
        for counts in _EVENTS.values():
            count = sum(map(counts, one.flights))
            low, high = rate_interval(count, hours)
            row += [count, *(round(_PER_H * rate, 1) for rate in (count / hours, low, high))]
        rows.append(tuple(row))
    return Table(
        name="rates",
        title=f"Events per {_PER_H:.0f} hours",
        columns=(
            *("tree", "hours", "metres per hour", "rooms covered per hour"),
            *(
                heading
                for event in _EVENTS
                for heading in (event, f"{event}, rate", f"{event}, from", f"{event}, to")
            ),
        ),
        rows=tuple(rows),
        note="From and to: the exact 95 % interval of the rate; without an event its upper end. "
        "A drone that hovers touches nothing, so the distance and the ground covered are beside.",
    )
