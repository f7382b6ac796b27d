"""What leaves share: ports that are numbers between two bounds, and the timer of costly stages."""

from __future__ import annotations

import time
from typing import Any

from uav_bt.board.context import MissionContext
from uav_bt.tree import Port


def number(
    name: str, default: float | None, least: float, most: float, doc: str, **more: Any
) -> Port[float]:
    """Return the port of a number from `least` to `most`; one without a default is required."""
    value = Port.REQUIRED if default is None else default
    return Port(name, float, value, doc, least=least, most=most, **more)


class StageTimer:
    """Adds the wall time of one stage to the mission's stage times, for the flight report."""

    def __init__(self, mission: MissionContext, stage: str) -> None:
        self._times = mission.stage_times_s.setdefault(stage, [])

    def __enter__(self) -> None:
        self._start_s = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        self._times.append(time.perf_counter() - self._start_s)
