"""The leaves that this package contributes to tree files."""

from __future__ import annotations

from typing import Final

from behaviours.fly.avoid import Avoid
from behaviours.fly.can_return import CanReturn
from behaviours.fly.corridor_clear import CorridorClear
from behaviours.fly.coverage_grows import CoverageGrows
from behaviours.fly.explore import Explore
from behaviours.fly.give_way import GiveWay
from behaviours.fly.go_to import GoTo
from behaviours.fly.helipad_center import HelipadCenter
from behaviours.fly.land import EmergencyLand, Land, LandHere
from behaviours.fly.look import HoverFor, Hovering, PointCamera, Turn
from behaviours.fly.mark import (
    Detour,
    GoToMarkUnderPolicy,
    MarkFound,
    ScanBelow,
    SearchUnderPolicy,
    StopAboveMark,
)
from behaviours.fly.move_by import ClimbTo, MoveBy
from behaviours.fly.moves_on import MovesOn
from behaviours.fly.objects import NextObject, ObjectSeen, ViewPoints
from behaviours.fly.places import Face
from behaviours.fly.say import Say
from behaviours.fly.take_off import TakeOff
from behaviours.fly.take_photo import TakePhoto
from behaviours.perceive.advise import Advise
from behaviours.perceive.class_map import FindMark, Segment
from behaviours.perceive.depth import BuildCorridor, EstimateDepth
from behaviours.perceive.motion import TrackMotion
from behaviours.perceive.recent_views import RememberViews
from behaviours.perceive.senses_agree import SensesAgree
from behaviours.perceive.site_map import MapSite
from uav_bt.tree import Node
from uav_bt.tree.rules import Rules

NODES: Final[tuple[type[Node], ...]] = (
    Advise,
    Avoid,
    BuildCorridor,
    CanReturn,
    ClimbTo,
    CorridorClear,
    CoverageGrows,
    Detour,
    EmergencyLand,
    EstimateDepth,
    Explore,
    Face,
    FindMark,
    GiveWay,
    GoTo,
    GoToMarkUnderPolicy,
    HelipadCenter,
    HoverFor,
    Hovering,
    Land,
    LandHere,
    MapSite,
    MarkFound,
    MoveBy,
    MovesOn,
    NextObject,
    ObjectSeen,
    PointCamera,
    RememberViews,
    Rules,
    Say,
    ScanBelow,
    SearchUnderPolicy,
    Segment,
    SensesAgree,
    StopAboveMark,
    TakeOff,
    TakePhoto,
    TrackMotion,
    Turn,
    ViewPoints,
)
