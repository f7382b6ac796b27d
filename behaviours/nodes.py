"""The leaves that this package contributes to tree files."""

from __future__ import annotations

from typing import Final

from behaviours.fly import look, mark
from behaviours.fly.course_leaf import GiveWay
from behaviours.fly.explore import Avoid, CorridorClear, CoverageGrows, Explore
from behaviours.fly.go_to import GoTo
from behaviours.fly.helipad_center import HelipadCenter
from behaviours.fly.land import EmergencyLand, Land, LandHere
from behaviours.fly.move_by import MoveBy
from behaviours.fly.objects import NextObject, ObjectSeen, ViewPoints
from behaviours.fly.places import Face
from behaviours.fly.take_off import ClimbTo, TakeOff
from behaviours.fly.take_photo import TakePhoto
from behaviours.perceive.class_map import FindMark, Segment
from behaviours.perceive.depth import BuildCorridor, EstimateDepth
from behaviours.perceive.recent_views import Advise, RememberViews
from behaviours.perceive.senses_agree import SensesAgree
from behaviours.perceive.site_map import MapSite, TrackMotion
from uav_bt.tree import Node
from uav_bt.tree.rules import Rules

NODES: Final[tuple[type[Node], ...]] = (
    *(Advise, BuildCorridor, EstimateDepth, FindMark, MapSite),
    *(RememberViews, Segment, SensesAgree, TrackMotion),
    *(Avoid, CorridorClear, CoverageGrows, Explore),
    *(look.CanReturn, look.HoverFor, look.Hovering, MoveBy, look.MovesOn),
    *(look.PointCamera, look.Say, look.Turn, mark.Detour, mark.GoToMarkUnderPolicy),
    *(mark.MarkFound, mark.ScanBelow, mark.SearchUnderPolicy, mark.StopAboveMark),
    *(NextObject, ObjectSeen, ViewPoints, ClimbTo, TakeOff, TakePhoto),
    *(Face, GiveWay, GoTo, HelipadCenter, Land, LandHere, EmergencyLand, Rules),
)
