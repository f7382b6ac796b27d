"""The leaves that this package contributes to tree files: each module lists its own."""

from __future__ import annotations

from typing import Final

from behaviours.fly import can_return, explore, look, move_by, objects, take_off, take_photo
from behaviours.fly.give_way import GiveWay
from behaviours.fly.go_to import GoTo
from behaviours.fly.helipad_center import HelipadCenter
from behaviours.fly.land import EmergencyLand, Land, LandHere
from behaviours.fly.mark import (
    Detour,
    GoToMarkUnderPolicy,
    MarkFound,
    ScanBelow,
    SearchUnderPolicy,
    StopAboveMark,
)
from behaviours.fly.places import Face
from behaviours.perceive.class_map import FindMark, Segment
from behaviours.perceive.depth import BuildCorridor, EstimateDepth
from behaviours.perceive.motion import TrackMotion
from behaviours.perceive.recent_views import Advise, RememberViews
from behaviours.perceive.senses_agree import SensesAgree
from behaviours.perceive.site_map import MapSite
from uav_bt.tree import Node
from uav_bt.tree.rules import Rules

NODES: Final[tuple[type[Node], ...]] = (
    *(Advise, BuildCorridor, EstimateDepth, FindMark, MapSite),
    *(RememberViews, Segment, SensesAgree, TrackMotion),
    *can_return.NODES,
    *explore.NODES,
    *look.NODES,
    *move_by.NODES,
    *objects.NODES,
    *take_off.NODES,
    *take_photo.NODES,
    *(Face, GiveWay, GoTo, GoToMarkUnderPolicy, Detour, StopAboveMark),
    *(HelipadCenter, Land, LandHere, EmergencyLand),
    *(MarkFound, ScanBelow, SearchUnderPolicy),
    Rules,
)
