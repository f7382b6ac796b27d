"""Positions of movers over time, exact and reproducible from a seed."""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Sequence

import numpy as np

from sim_bridge.twin.movers import MoverSpec, mover_names
from sim_bridge.twin.noise import child_seed
from uav_bt.types import MoverState, Pose


class Route:
    """Motion of one mover over time: runs of its path, each after a pause if pauses are given."""

    def __init__(self, spec: MoverSpec, name: str, seed: int, number: int) -> None:
        self._spec = spec
        self._name = name
        self._random = np.random.default_rng(child_seed(seed, 9, number))
        self._legs = list(spec.legs())
        # Path length from the start of a run to the end of each leg, m.
        self._ends_m = list(itertools.accumulate(math.dist(*ends) for ends in self._legs))
        self._way_s = self._ends_m[-1] / spec.speed_mps
        self._starts_s = [self._pause_s()]  # start time of each run until now

    def _pause_s(self) -> float:
        return float(self._random.uniform(*self._spec.pauses_s)) if self._spec.pauses_s else 0.0

    def at(self, time_s: float) -> MoverState:
        """Return the position and velocity at a time since the start of the simulation, s."""
        starts = self._starts_s
        while starts[-1] + self._way_s <= time_s:
            starts.append(starts[-1] + self._way_s + self._pause_s())
        way = max(bisect.bisect_right(starts, time_s) - 1, 0)
        spent_s = time_s - starts[way]
        moves = 0.0 <= spent_s < self._way_s
        along_m = min(max(spent_s, 0.0) * self._spec.speed_mps, self._ends_m[-1])
        back = not self._spec.loop and way % 2 == 1
        if back:
            along_m = self._ends_m[-1] - along_m
        leg = min(bisect.bisect_right(self._ends_m, along_m), len(self._legs) - 1)
        (x, y), (end_x, end_y) = self._legs[leg]
        length_m = math.dist((x, y), (end_x, end_y))
        ux, uy = (end_x - x) / length_m, (end_y - y) / length_m
        rest_m = along_m - (self._ends_m[leg] - length_m)
        speed = self._spec.speed_mps * (-1.0 if back else 1.0) if moves else 0.0
        return MoverState(
            name=self._name,
            pose=Pose(
                x_m=x + rest_m * ux,
                y_m=y + rest_m * uy,
                z_m=self._spec.size_m[2] / 2,
                yaw_rad=math.radians(self._spec.yaw_deg),
            ),
            vx_mps=speed * ux,
            vy_mps=speed * uy,
        )


class Traffic:
    """All movers of a scene over time; their pauses are drawn from the seed of the flight."""

    def __init__(self, movers: Sequence[MoverSpec], seed: int) -> None:
        self._routes = [
            Route(spec, name, seed, number)
            for number, (spec, name) in enumerate(zip(movers, mover_names(movers), strict=True))
        ]

    def at(self, time_s: float) -> tuple[MoverState, ...]:
        """Return the states of all movers at a time since the start of the simulation, s."""
        return tuple(route.at(time_s) for route in self._routes)
