"""Detection of views that contradict the map, because the drone's pose on it is wrong."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class ContradictionConfig:
    """When a map is abandoned."""

    # Views contradict the map if they show only ground at more than this share of its points in
    # view. Under heavy drift the share was 0.25; chosen above it.
    share: float = 0.4
    judged_s: float = 3.0  # time constant with which earlier views are forgotten. Chosen.
    judged_points: float = 80.0  # least number of points in these views. Chosen.
    restart_s: float = 2.0  # a map contradicted for longer is restarted. Chosen.
    gap_s: float = 0.5  # longer gaps between views do not count as contradiction. Chosen.


class Contradiction:
    """Counts the map's points at which views show ground.

    Args:
        config: when a map is abandoned.
        agreed_s: time of the last view that agreed with the map; -inf before any.
    """

    def __init__(self, config: ContradictionConfig, *, agreed_s: float = -math.inf) -> None:
        self._config = config
        self._agreed_s = agreed_s
        self._judged_s = -math.inf
        self._points = np.zeros(2)  # points of the map in views, and those that showed ground

    def add(self, time_s: float, in_view: int, free: int) -> None:
        """Add the agreement of a view with the map.

        Args:
            time_s: capture time of the view.
            in_view: number of the map's points in the view.
            free: number of these points at which the view shows ground.
        """
        cfg, unseen_s = self._config, time_s - self._judged_s
        self._points = self._points * math.exp(-unseen_s / cfg.judged_s) + (in_view, free)
        self._judged_s = time_s
        if cfg.gap_s < unseen_s < math.inf:
            self._agreed_s += unseen_s
        in_all, gone = self._points
        if in_all < cfg.judged_points or gone <= cfg.share * in_all:
            self._agreed_s = time_s

    def lasts_s(self, time_s: float) -> float:
        """Return the time for which views have contradicted the map, s."""
        return max(0.0, time_s - self._agreed_s) if self._agreed_s > -math.inf else 0.0

    def is_certain(self, time_s: float) -> bool:
        """Return whether the map must be restarted."""
        return self.lasts_s(time_s) > self._config.restart_s
