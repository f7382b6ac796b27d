"""ReturnToBase: search for the helipad, fly to it, and stop above it."""

from __future__ import annotations

import math
from typing import ClassVar

from behaviours.fly.giving_way import GIVES_WAY, GivingWay
from behaviours.fly.pad_approach import PadApproach
from behaviours.fly.pad_search import PadSearch
from behaviours.fly.steering import FLOWING, POLICY, SteeringLeaf
from uav_bt.board import HELIPAD
from uav_bt.board.context import MissionContext
from uav_bt.errors import UnknownNameError
from uav_bt.tree import Port, Status
from uav_bt.types import DroneState

_APPROACHES = ("memory", "policy")


class ReturnToBase(SteeringLeaf):
    """Search for the helipad and approach it; SUCCESS above it.

    The search goes by the map of the place where there is one, else by a leaf policy.
    """

    ports = (
        POLICY,
        FLOWING,
        GIVES_WAY,
        Port(
            "gimbal_deg",
            float,
            default=-30.0,
            least=-90,
            most=90,
            doc="camera pitch while searching, degrees",
        ),
        Port(
            "arrive_m",
            float,
            default=0.12,
            least=0.01,
            most=2,
            doc="horizontal distance that counts as above, m",
        ),
        Port(
            "approach",
            str,
            default="memory",
            doc="what finds the path to the pad: 'memory' of obstacles, or the 'policy'",
        ),
    )
    reads = (*SteeringLeaf.reads, HELIPAD)
    by_map: ClassVar[bool] = True  # False: always under the policy

    def on_setup(self, mission: MissionContext) -> None:
        """Make the search and the approach.

        Raises:
            UnknownNameError: no policy or no approach has that name.
        """
        super().on_setup(mission)
        approach = self.port_value("approach")
        if approach not in _APPROACHES:
            raise UnknownNameError("approach", approach, _APPROACHES)
        self._flight_rad = math.radians(self.port_value("gimbal_deg"))
        by_policy = approach == "policy"
        by_map = self.by_map and not by_policy
        self._search = PadSearch(self, flight_rad=self._flight_rad, by_map=by_map)
        self._approach = PadApproach(
            self,
            flight_rad=self._flight_rad,
            arrive_m=self.port_value("arrive_m"),
            by_policy=by_policy,
        )
        self._giving_way = GivingWay(self)
        self._searching = True

    def initialise(self) -> None:
        """Begin with the search; a helipad in view ends it at once."""
        self._approach.reset()
        self._search.start_clock()
        self._begin_search()

    def work(self, state: DroneState) -> Status:
        """Search until the pad is found, then approach it until it is reached or lost."""
        if self._giving_way.work():
            return Status.RUNNING
        if self._searching:
            if self._search.work(state) is not Status.SUCCESS:
                return Status.RUNNING
            self._searching = False
            self._approach.begin()
        fix = self.read(HELIPAD).value
        believed = fix is None or self._search.believes(fix)
        status = self._approach.work(state) if believed else Status.FAILURE
        if status is not Status.RUNNING:
            self._search.gave_up(fix)
        if status is Status.FAILURE:
            self._begin_search()
            return Status.RUNNING
        return status

    def gimbal_pitch_rad(self) -> float:
        """Return the camera's pitch; while it gives way, what moves is to stay in view."""
        if self._giving_way.active:
            return self._flight_rad
        return self._search.pitch_rad() if self._searching else self._approach.pitch_rad()

    def _begin_search(self) -> None:
        self._searching = True
        self._search.begin()
