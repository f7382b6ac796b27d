"""Whether views contradict the map: the drone is elsewhere than the map believes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class ContradictionConfig:
    """When a map is given up."""

    # Views contradict the map when they show only ground at more than this share of its points that
    # lie in them. Under heavy drift a quarter was seen; chosen above it.
    share: float = 0.4
    judged_s: float = 3.0  # time constant with which earlier views are forgotten. Chosen.
    judged_points: float = 80.0  # fewer points in all those views do not count. Chosen.
    restart_s: float = 2.0  # a map contradicted for longer is begun anew. Chosen.
    gap_s: float = 0.5  # longer gaps between views are ignored when judging the map. Chosen.


class Contradiction:
    """Counts the map's points that views show to be ground.

    Args:
        config: when a map is given up.
        agreed_s: when a view agreed with the map last; -inf before any.
    """

    def __init__(self, config: ContradictionConfig, *, agreed_s: float = -math.inf) -> None:
        self._config = config
        self._agreed_s = agreed_s
        self._judged_s = -math.inf
        self._points = np.zeros(2)  # of the map that lay in views, and those shown to be ground

    def add(self, time_s: float, in_view: int, free: int) -> None:
        """Take in how a view agrees with the map.

        Args:
            time_s: capture of the view.
            in_view: number of the map's points that lie in it.
            free: number of those that it shows to be ground.
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
        """Return for how long views have contradicted the map at a time."""
        return max(0.0, time_s - self._agreed_s) if self._agreed_s > -math.inf else 0.0

    def is_certain(self, time_s: float) -> bool:
        """Return whether the map is to be begun anew."""
        return self.lasts_s(time_s) > self._config.restart_s
