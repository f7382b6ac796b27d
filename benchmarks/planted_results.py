"""Results of the searches for planted defects, as rows of a table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from benchmarks.planted_edits import Defect
from uav_bt.mission.judge import Outcome

Line = Mapping[str, Any]
"""A flight's line."""


@dataclass(frozen=True, kw_only=True)
class Search:
    """How one defect's search ended.

    Attributes:
        flights: Number of flights.
        hours: Their simulated time.
        minutes: Their wall time.
        limit_minutes: Wall time after which the search was given up.
        how: How the flight failed that found the defect; None: none did.
        left: Faults, movers and boxes that the failure needs; None: not reduced in time.
        in_twin: Whether the flight, reduced if it was, finds the defect in the twin with images.
    """

    flights: int
    hours: float
    minutes: float
    limit_minutes: float
    how: str | None = None
    left: str | None = None
    in_twin: bool | None = None

    def row(self, defect: Defect) -> str:
        """Return a row of the table."""
        twin = {None: "-", True: "yes", False: "no"}[self.in_twin]
        cells = (
            defect.name,
            defect.fixed_in or "-",
            "no" if self.how is None else "yes",
            f"{self.hours:.2f}",
            f"{self.minutes:.1f}",
            str(self.flights),
            self.how or "-",
            twin,
            self.left or "-",
        )
        return f"| {' | '.join(cells)} |"


HEAD: Final = (
    "| defect | fixed in | found | hours | minutes | flights | how | in the twin "
    "| faults, movers, boxes |\n|---|---|---|---:|---:|---:|---|---|---|"
)


# Outcomes from the least severe on; a contact, an exit and an error are equal.
_SEVERITY: Final = {
    Outcome.SUCCESS.value: 0,
    Outcome.ABORTED.value: 1,
    Outcome.TIMEOUT.value: 2,
    **dict.fromkeys((Outcome.LEFT_AREA.value, Outcome.COLLISION.value, Outcome.ERROR.value), 3),
}


def difference(line: Line, sound: Line) -> str | None:
    """Return how a flight with a defect ends worse than the one without; None: it does not.

    Args:
        line: The flight with the defect.
        sound: The same flight without.
    """
    if line.get("airborne_at_end") and not sound.get("airborne_at_end"):
        return f"left in the air: {line['reason']}"
    if _SEVERITY[line["outcome"]] > _SEVERITY[sound["outcome"]]:
        return f"{line['outcome']}: {line['reason']}"
    return None
