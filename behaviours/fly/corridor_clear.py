"""CorridorClear: is there room ahead? With it a tree file vetoes whoever chooses the way."""

from __future__ import annotations

import math

from behaviours.policies.corridor_rule import CorridorRuleConfig, carpet_reach
from behaviours.policies.view import VIEW_KEYS, current_view, policy_view
from uav_bt.board import CORRIDOR, HELIPAD, OBSTACLES
from uav_bt.board.context import MissionContext
from uav_bt.classes import group_of
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types import HeldTurn

_RULE = CorridorRuleConfig()
_AHEAD_RAD = math.radians(20)
_ABOVE_M = 0.5  # the last of an approach is flown without seeing the pad


class CorridorClear(Leaf):
    """SUCCESS while there is room ahead, between obstacles and on the carpet; FAILURE otherwise.

    A corridor that is not known, or known too long ago, is none to fly in. The defaults ask for
    less than the rule `corridor` does: where that finds the way free this does, too, and the two
    never take turns for ever.
    """

    condition = True
    ports = (
        Port("ahead_m", float, default=0.8, doc="room ahead of the body's centre, m"),
        Port("impact_s", float, default=1.2, doc="least time to impact at the present speed, s"),
        # Shorter than the shortest step.
        Port(
            "way_m", float, default=0.3, doc="way that must keep clear of remembered obstacles, m"
        ),
        Port("beside_m", float, default=0.42, doc="room to them along that way, m"),
        Port(
            "carpet_m",
            float,
            default=0.6,
            doc="carpet ahead of the body's centre, m; not asked where the pad lies ahead",
        ),
    )
    reads = (*VIEW_KEYS, HELIPAD)

    def on_setup(self, mission: MissionContext) -> None:
        """Begin without a judgement of the carpet."""
        del mission
        self._carpet_ends = False

    def update(self) -> Status:
        """Look at what the corridor, the memory of obstacles and the carpet leave."""
        self.feedback_message = self._objection()
        return Status.FAILURE if self.feedback_message else Status.SUCCESS

    def _objection(self) -> str:
        corridor, obstacles = self.read(CORRIDOR).value, self.read(OBSTACLES).value
        ahead_m = self.port_value("ahead_m")
        if corridor is None:
            return "corridor unknown"
        if corridor.free_distance_m < ahead_m:
            return f"{corridor.free_distance_m:.2f} m ahead"
        if corridor.time_to_impact_s < self.port_value("impact_s"):
            return f"impact in {corridor.time_to_impact_s:.1f} s"
        if obstacles is not None and not obstacles.allows(
            self.port_value("way_m"), margin_m=self.port_value("beside_m"), assumed=False
        ):
            return f"obstacle {obstacles.nearest_m:.2f} m away"
        return "carpet ends" if self._carpet_is_short() and not self._pad_is_ahead() else ""

    def _pad_is_ahead(self) -> bool:
        """Return whether the way ahead is the way to the pad, which stands on carpet anyway."""
        pad = self.read(HELIPAD).value
        return pad is not None and (abs(pad.bearing_rad) < _AHEAD_RAD or pad.range_m < _ABOVE_M)

    def _carpet_is_short(self) -> bool:
        """Judge the carpet on a new view; between two views the last judgement stands."""
        seen = current_view(self)
        if seen is not None:
            view = policy_view(self, *seen, held=HeldTurn(), tie_break=0.5)
            reach_m = carpet_reach(group_of(view.class_map.ids), view, _RULE)
            reach_m += view.camera.forward_offset_m
            self._carpet_ends = reach_m < self.port_value("carpet_m")
        return self._carpet_ends
