"""The leaves that this package contributes to tree files."""

from __future__ import annotations

from typing import Final

from behaviours.advise import Advise
from behaviours.avoid import Avoid
from behaviours.corridor_clear import CorridorClear
from behaviours.explore import Explore
from behaviours.helipad_center import HelipadCenter
from behaviours.land import EmergencyLand, Land
from behaviours.look import HelipadKnown, HoverFor, Hovering, PointCamera, Turn
from behaviours.perceive import FindHelipad, RememberObstacles, Segment
from behaviours.perceive_depth import BuildCorridor, EstimateDepth
from behaviours.remember_views import RememberViews
from behaviours.return_to_base import ReturnToBase
from behaviours.take_off import TakeOff
from uav_bt.tree import Leaf

__all__ = ["NODES"]

NODES: Final[tuple[type[Leaf], ...]] = (
    Advise,
    Avoid,
    BuildCorridor,
    CorridorClear,
    EmergencyLand,
    EstimateDepth,
    Explore,
    FindHelipad,
    HelipadCenter,
    HelipadKnown,
    HoverFor,
    Hovering,
    Land,
    PointCamera,
    RememberObstacles,
    RememberViews,
    ReturnToBase,
    Segment,
    TakeOff,
    Turn,
)
