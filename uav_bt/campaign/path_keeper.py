"""The way a flight took, thin enough to be kept for a thousand of them."""

from __future__ import annotations

from typing import Final

from uav_bt.mission.runner import TickRecord

_INTERVAL_S: Final = 0.5  # at 0.5 m/s a point every quarter of a metre: maps need no more


class PathKeeper:
    """Listens to the runner and keeps the referee's positions at 2 Hz; nothing without a referee.

    Attributes:
        points: time in mission seconds, and x, y, z in world metres, all to the thousandth.
    """

    def __init__(self) -> None:
        self.points: list[tuple[float, float, float, float]] = []
        self._next_s = 0.0

    def on_tick(self, record: TickRecord) -> None:
        """Take note of a tick."""
        # Half a tick early is on time: ticks are a tenth of a second, and floats add up.
        if record.truth is None or record.time_s < self._next_s - 0.05:
            return
        self._next_s = record.time_s + _INTERVAL_S
        pose = record.truth.pose
        self.points.append(
            (
                round(record.time_s, 3),
                round(pose.x_m, 3),
                round(pose.y_m, 3),
                round(pose.z_m, 3),
            )
        )
