"""The report's table of the maps: the objects found and their errors of position."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from uav_bt.campaign.report.sources import FlightSet
from uav_bt.campaign.report.statistics import PERCENTILE_FLIGHTS
from uav_bt.campaign.report.table import Cell, Table
from uav_bt.mission.map_check import FOUND_M

_NOTE: Final = (
    f"An object counts as found if the map has an object of its class within {FOUND_M:g} m. The "
    "pose at take-off aligns the map with the place, so the errors of position contain the drift. "
    "They are those of all found objects."
)


def map_table(sets: Sequence[FlightSet]) -> Table:
    """Return objects and errors of the maps by tree; a tree without a map has no row."""
    rows: list[tuple[Cell, ...]] = []
    for one in sets:
        mapped = [f for f in one.flights if f.get("objects_total") is not None]
        if not mapped:
            continue
        found, total, false, restarts = (
            sum(flight.get(name) or 0 for flight in mapped)
            for name in ("objects_found", "objects_total", "false_objects", "map_restarts")
        )
        errors_m = [error for flight in mapped for error in flight.get("object_errors_m") or []]
        numbers: tuple[float | None, ...] = (None,) * 4
        if errors_m:
            median, late = np.percentile(errors_m, [50, 95])
            late = late if len(mapped) >= PERCENTILE_FLIGHTS else None
            numbers = tuple(
                None if each is None else round(float(each), 3)
                for each in (np.mean(errors_m), median, late, max(errors_m))
            )
        share = round(100.0 * found / total, 1) if total else None
        rows.append((one.label, len(mapped), found, total, share, false, *numbers, restarts))
    return Table(
        name="map",
        title="The mission's map",
        columns=(
            *("tree", "flights", "objects found", "of", "found, %", "false objects"),
            *("error, m: mean", "median", "95 %", "most", "restarts"),
        ),
        rows=tuple(rows),
        note=_NOTE,
    )
