"""CorridorClear: condition for free space ahead, with which a tree can veto a policy."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

from behaviours.policies.corridor_rule import CorridorRuleConfig, ground_reach
from behaviours.policies.view import VIEW_KEYS, current_view, policy_view
from uav_bt.board import CORRIDOR, MARK, SITE_MAP
from uav_bt.board.context import MissionContext
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types import HeldTurn


@dataclass(frozen=True, kw_only=True)
class CorridorClearConfig:
    """How the ground ahead is measured, and when the pad ahead counts as ground."""

    pad_ahead_rad: float = math.radians(20)  # largest bearing of a pad that the ground extends to
    pad_below_m: float = 0.5  # a pad nearer than this is below the view, whatever its bearing
    rule: CorridorRuleConfig = field(default_factory=CorridorRuleConfig)  # for the ground's reach


class CorridorClear(Leaf):
    """SUCCESS while there is room ahead, between obstacles and on the ground; FAILURE otherwise.

    FAILURE on an unknown or stale corridor. The defaults require less room than the rule
    `corridor`: this condition succeeds wherever that rule advances, so the two cannot alternate
    forever.
    """

    config: ClassVar[CorridorClearConfig] = CorridorClearConfig()
    condition = True
    ports = (
        Port(
            "ahead_m",
            float,
            default=0.8,
            least=0,
            most=50,
            doc="room ahead of the body's centre, m",
        ),
        Port(
            "impact_s",
            float,
            default=1.2,
            least=0,
            most=60,
            doc="least time to impact at the present speed, s",
        ),
        # Shorter than the shortest step.
        Port(
            "way_m",
            float,
            default=0.3,
            least=0,
            most=20,
            doc="path that must keep clear of remembered obstacles, m",
        ),
        Port(
            "beside_m", float, default=0.42, least=0, most=20, doc="room to them along that path, m"
        ),
        Port(
            "ground_m",
            float,
            default=0.6,
            least=0,
            most=50,
            doc="ground ahead of the body's centre, m; not needed where the pad lies ahead",
        ),
    )
    reads = (*VIEW_KEYS, MARK)

    def on_setup(self, mission: MissionContext) -> None:
        """Begin before the first view of the ground."""
        del mission
        self._ground_ends = False

    def update(self) -> Status:
        """Compare the corridor, the obstacles of the map and the ground with the ports."""
        self.feedback_message = self._objection()
        return Status.FAILURE if self.feedback_message else Status.SUCCESS

    def _objection(self) -> str:
        corridor, site_map = self.read(CORRIDOR).value, self.read(SITE_MAP).value
        ahead_m = self.port_value("ahead_m")
        if corridor is None:
            return "corridor unknown"
        if corridor.free_distance_m < ahead_m:
            return f"{corridor.free_distance_m:.2f} m ahead"
        if corridor.time_to_impact_s < self.port_value("impact_s"):
            return f"impact in {corridor.time_to_impact_s:.1f} s"
        if site_map is not None and not site_map.near.allows(
            self.port_value("way_m"), margin_m=self.port_value("beside_m"), assumed=False
        ):
            return f"obstacle {site_map.near.nearest_m:.2f} m away"
        return "ground ends" if self._ground_is_short() and not self._pad_is_ahead() else ""

    def _pad_is_ahead(self) -> bool:
        """Return whether the pad, which stands on ground, is ahead."""
        cfg, pad = self.config, self.read(MARK).value
        return pad is not None and (
            abs(pad.bearing_rad) < cfg.pad_ahead_rad or pad.range_m < cfg.pad_below_m
        )

    def _ground_is_short(self) -> bool:
        """Return whether the ground ahead is too short in the newest view with a class map."""
        seen = current_view(self)
        if seen is not None:
            view = policy_view(self, *seen, held=HeldTurn(), tie_break=0.5)
            reach_m = ground_reach(view.class_map.roles, view, self.config.rule)
            reach_m += view.camera.forward_offset_m
            self._ground_ends = reach_m < self.port_value("ground_m")
        return self._ground_ends
