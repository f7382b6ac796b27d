"""CoverageGrows: does exploring still cover new ground? With it a tree ends a survey early."""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np

from behaviours.fly.leaf_clock import LeafClock
from uav_bt.board import SITE_MAP
from uav_bt.board.context import MissionContext
from uav_bt.tree import Leaf, Port, Status

_SAME_S: Final = 1e-6  # times that differ by less are equal


class CoverageGrows(Leaf):
    """SUCCESS while the path covers new ground of the site map; FAILURE when it hardly does.

    Covered ground lies within half a metre of the flown path. The window restarts after a pause of
    the leaf. Without a map, and before the first window has passed, the answer is SUCCESS.
    """

    condition = True
    ports = (
        Port(
            "min_share",
            float,
            default=0.01,
            least=0,
            most=1,
            doc="newly covered share of the known ground that a window must bring; 0: none",
        ),
        Port("window_s", float, default=30.0, least=1, most=3600, doc="length of the window, s"),
    )
    reads = (SITE_MAP,)

    def on_setup(self, mission: MissionContext) -> None:
        """Start without a history."""
        self._clock = LeafClock(mission.clock)
        self._history: deque[tuple[float, int]] = deque()  # time, s; covered cells
        self._restarts = 0  # of the map whose cells these are

    def update(self) -> Status:
        """Compare the covered share with that of one window ago."""
        if self._clock.tick() > 0:
            self._history.clear()
        site_map, now_s = self.read(SITE_MAP).value, self._clock.now()
        if site_map is None:
            return Status.SUCCESS
        if site_map.restarts != self._restarts:
            self._restarts = site_map.restarts
            self._history.clear()
        self._history.append((now_s, int(np.count_nonzero(site_map.ground & site_map.passed))))
        while (
            len(self._history) > 1
            and self._history[1][0] <= now_s - self.port_value("window_s") + _SAME_S
        ):
            self._history.popleft()
        since_s, before = self._history[0]
        if now_s - since_s < self.port_value("window_s") - _SAME_S:
            return Status.SUCCESS
        known = int(np.count_nonzero(site_map.ground))
        gained = (self._history[-1][1] - before) / max(known, 1)
        self.feedback_message = f"{100 * gained:.1f} % in {now_s - since_s:.0f} s"
        least = self.port_value("min_share")
        return Status.SUCCESS if least == 0 or gained >= least else Status.FAILURE
