"""Whole missions that are interrupted: by a person, by faults, by the drone."""

import math
from dataclasses import replace
from typing import Any

import pytest

from tests.paper_lab import paper_map
from tests.worlds.leaves import ADVANCE, TURN_RIGHT
from tests.worlds.trees import document
from uav_bt.board import CAMERA, CLASS_MAP, FRAME, MARK, STATE
from uav_bt.board.context import MissionContext
from uav_bt.mission.judge import Judge, JudgeConfig, Outcome, Verdict
from uav_bt.mission.runner import MissionRunner
from uav_bt.mission.safety import Override
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import LeafPolicy
from uav_bt.testing import ScriptedDrone
from uav_bt.testing.faults import Fault, FaultyDrone
from uav_bt.testing.world import Says, ground
from uav_bt.tree import Leaf, NodeRegistry, Status, parse_tree
from uav_bt.types import MarkFix, MoveBy
from uav_bt.types.place import LandOn

MISSION = """
<ReactiveSequence>
  <Sense/>
  <Sequence>
    <TakeOff height_m="1.5" give_up_s="8"/>
    <Turn degrees="90"/>
    <HoverFor seconds="3"/>
    <ForceSuccess><Timeout msec="20000"><Explore policy="segmentation"/></Timeout></ForceSuccess>
    <Avoid policy="corridor"/>
    <ReturnToBase policy="segmentation"/>
    <HelipadCenter give_up_s="12"/>
    <Land/>
  </Sequence>
</ReactiveSequence>"""
GROUND = ground()
NEAREST_AHEAD_M = 1.0  # nearer ground is below the view ahead


def sense(drone: ScriptedDrone) -> type[Leaf]:
    """Return a leaf that sees ground everywhere and the pad where the drone took off."""

    class Sense(Leaf):
        """Perceive."""

        condition = True
        reads = (FRAME, STATE, CAMERA)
        writes = (CLASS_MAP, MARK)
        seen_s = 0.0

        def update(self) -> Status:
            frame = self.read(FRAME).value
            if frame is None:
                return Status.SUCCESS
            self.write(CLASS_MAP, paper_map(GROUND, captured_s=frame.captured_s))
            heading, x_m, y_m = drone.state.attitude.yaw_rad, -drone.x_m, -drone.y_m
            ahead = math.hypot(x_m, y_m) > NEAREST_AHEAD_M
            detected = ahead or frame.gimbal_pitch_rad < math.radians(-80)
            if detected:
                self.seen_s = frame.captured_s
            fix = MarkFix(
                captured_s=self.seen_s,
                forward_m=x_m * math.cos(heading) - y_m * math.sin(heading),
                right_m=-x_m * math.sin(heading) - y_m * math.cos(heading),
                height_m=0.4,
                detected=detected,
            )
            self.write(MARK, fix, self.seen_s)
            return Status.SUCCESS

    return Sense


class World:
    """A mission on a scripted drone, and what interrupts it."""

    def __init__(self, body: str, fault: str, place: str, duration_s: float = math.inf) -> None:
        # A movement takes 1.5 s, so that it is under way when it is interrupted.
        self.inner = ScriptedDrone(movement_ticks=15)
        self.inner.camera = replace(self.inner.camera, forward_offset_m=0.15)
        self.drone: Any = self.inner
        listeners: list[Any] = [self]
        if fault != BY_HAND:
            text = f"{fault}@{place}" + (f"~{duration_s}" if duration_s < math.inf else "")
            self.drone = FaultyDrone(self.inner, Fault.parse(text))
            listeners.append(self.drone)
        # In place of the installed ones, which would need something to see.
        policies: dict[str, LeafPolicy] = {
            "segmentation": Says(ADVANCE),
            "corridor": Says(*[TURN_RIGHT] * 30, ADVANCE),
        }
        context = MissionContext(clock=self.inner.clock, policy=policies.__getitem__)
        registry = NodeRegistry.installed().with_nodes(sense(self.inner))
        self.tree = parse_tree(document(body), registry)
        self.tree.setup(context)
        judge = Judge(JudgeConfig(land_on=LandOn.ANY))
        self.runner = MissionRunner(self.drone, self.tree, context, judge, listeners=listeners)
        self.records: list[TickRecord] = []
        self.takes_over = place if fault == BY_HAND else None  # PHASE+SECONDS
        self._took_over_s: float | None = None

    def on_tick(self, record: TickRecord) -> None:
        """Take over for 10 s, where it was asked for."""
        self.records.append(record)
        if self.takes_over is None:
            return
        phase, _, after_s = self.takes_over.partition("+")
        if self._took_over_s is None and record.phase == phase:
            self._took_over_s = record.time_s + float(after_s)
        if self._took_over_s is not None:
            late_s = record.time_s - self._took_over_s
            self.runner.manual = -1e-6 <= late_s < 10.0

    def fly(self) -> Verdict:
        self.drone.connect()
        return self.runner.run()


PLACES = {
    "TakeOff": "take-off+1",
    "Turn": "look+0.5",
    "HoverFor": "hover+0.5",
    "Explore": "explore+1",
    "Avoid": "explore+21",
    "ReturnToBase": "approach+2",
    "HelipadCenter, up": "center+0.5",
    "HelipadCenter, down": "center+2",
    "Land": "land+0.5",
}
TURN = '<Sequence><TakeOff height_m="1"/><Turn degrees="90"/><Land/></Sequence>'
BY_HAND = "by hand"
FAULTS = [BY_HAND, "pilot", "video-lost", "link-lost", "interrupted"]


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES.keys())
@pytest.mark.parametrize("fault", FAULTS)
def test_what_passes_ends_no_mission(place: str, fault: str) -> None:
    """A person flies for longer than the leaves' own time limits leave room for."""
    world = World(MISSION, fault, place, 10.0 if fault == "pilot" else 2.5)
    assert world.fly() == Verdict(outcome=Outcome.SUCCESS, reason="landed")
    manual = sum(each.override is Override.MANUAL for each in world.records)
    assert manual >= 99 if fault == BY_HAND else world.drone.began_s is not None


@pytest.mark.parametrize("fault", FAULTS)
def test_an_interrupted_turn_ends_at_its_heading(fault: str) -> None:
    world = World(TURN, fault, "look+0.5", 3.0)
    assert world.fly().outcome is Outcome.SUCCESS
    assert math.degrees(world.inner.state.attitude.yaw_rad) == pytest.approx(90)
    assert {record.override for record in world.records} != {None} or fault == "interrupted"
    turns = {
        record.command.movement.id
        for record in world.records
        if isinstance(record.command.movement, MoveBy) and record.command.movement.yaw_rad != 0.0
    }
    assert len(turns) > 1, "it was begun again"


@pytest.mark.parametrize("fault", FAULTS[1:])
def test_an_emergency_landing_goes_on_too(fault: str) -> None:
    body = '<Sequence><Sense/><TakeOff height_m="1"/><EmergencyLand/></Sequence>'
    world = World(body, fault, "emergency landing+0.2", 8.0)
    assert world.fly().reason == "the tree failed; landed"
