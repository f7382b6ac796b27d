"""The leaves that this package contributes to tree files."""

from __future__ import annotations

from typing import Final

from behaviours.fly.avoid import Avoid
from behaviours.fly.corridor_clear import CorridorClear
from behaviours.fly.explore import Explore
from behaviours.fly.helipad_center import HelipadCenter
from behaviours.fly.land import EmergencyLand, Land
from behaviours.fly.look import HelipadKnown, HoverFor, Hovering, PointCamera, Turn
from behaviours.fly.return_to_base import ReturnToBase
from behaviours.fly.take_off import TakeOff
from behaviours.perceive.advise import Advise
from behaviours.perceive.class_map import FindHelipad, Segment
from behaviours.perceive.depth import BuildCorridor, EstimateDepth
from behaviours.perceive.motion import TrackMotion
from behaviours.perceive.recent_views import RememberViews
from behaviours.perceive.site_map import MapSite
from uav_bt.tree import Leaf

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
    MapSite,
    PointCamera,
    RememberViews,
    ReturnToBase,
    Segment,
    TakeOff,
    TrackMotion,
    Turn,
)
