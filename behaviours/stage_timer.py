"""Timer of a tick's costly stages, for the flight report."""

from __future__ import annotations

import time

from uav_bt.board.context import MissionContext


class StageTimer:
    """Adds the wall time of one stage to the mission's stage times."""

    def __init__(self, mission: MissionContext, stage: str) -> None:
        self._times = mission.stage_times_s.setdefault(stage, [])

    def __enter__(self) -> None:
        self._start_s = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        self._times.append(time.perf_counter() - self._start_s)
