"""A recording stream that stores its calls, and the setting and ticks of a small flight."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from uav_bt.board import MISSION_KEYS
from uav_bt.board.blackboard import Blackboard
from uav_bt.clock import ManualClock
from uav_bt.display.lab_map import LabMap, MapItem
from uav_bt.display.rerun.setting import CorridorSize, TreeNode, ViewSetting
from uav_bt.lab.classes import LabClass, LabClasses
from uav_bt.mission.tick import TickRecord
from uav_bt.testing import blank_frame, pinhole
from uav_bt.tree import Status
from uav_bt.types import HOVER, Attitude, Command, DroneState, FlyingState, Observation, Pose, Truth

CAMERA = pinhole(64, 36)
CLASSES = LabClasses(
    [
        LabClass(name="wall", role="outside", colour=(40, 40, 48)),
        LabClass(name="floor", role="ground", colour=(126, 158, 120)),
        LabClass(name="drum", role="obstacle", colour=(214, 39, 40)),
    ]
)
LAB = LabMap(
    ground_size_m=(5.0, 4.0),
    boxes=(MapItem(x_m=1.0, y_m=1.0, size_m=(0.4, 0.4, 1.9), colour=(200, 10, 20)),),
    mark=MapItem(x_m=-1.5, y_m=-1.0, size_m=(0.5, 0.5, 0.4), colour=(255, 196, 0)),
)
NODES = (
    TreeNode(path="Main/root", label="root", parent=None),
    TreeNode(path="Main/root/first", label="first", parent="Main/root"),
    TreeNode(path="Main/root/second", label="second", parent="Main/root"),
    TreeNode(path="Main/root/second/leaf", label="leaf", parent="Main/root/second"),
)


@dataclass
class Noted:
    entity: str
    things: tuple[Any, ...]
    static: bool
    time_s: float | None

    @property
    def thing(self) -> Any:
        return self.things[0]


@dataclass
class NotedStream:
    """Replaces a `rerun.RecordingStream`."""

    notes: list[Noted] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    time_s: float | None = None

    def log(self, entity: str, *things: Any, static: bool = False) -> None:
        self.notes.append(Noted(entity, things, static, self.time_s))

    def set_time(self, timeline: str, *, duration: float) -> None:
        assert timeline == "flight"
        self.time_s = duration

    def set_log_time_enabled(self, enabled: object) -> None:
        assert not enabled

    def set_log_tick_enabled(self, enabled: object) -> None:
        assert not enabled

    def send_recording_name(self, name: str) -> None:
        self.names.append(name)

    def of(self, entity: str) -> list[Noted]:
        return [note for note in self.notes if note.entity == entity]

    def last(self, entity: str) -> Any:
        return self.of(entity)[-1].thing


def values(batch: Any) -> list[Any]:
    """Return the values of a component of an archetype."""
    plain: list[Any] = batch.as_arrow_array().to_pylist()
    return plain


def setting(**changes: Any) -> ViewSetting:
    told: dict[str, Any] = {
        "camera": CAMERA,
        "classes": CLASSES,
        "title": "tour",
        "lab_map": LAB,
        "tree": NODES,
        "makes_depth": True,
        "corridor": CorridorSize(side_m=0.5, front_m=2.0, up_down_m=0.8),
    }
    return ViewSetting(**{**told, **changes})


class World:
    """A board with its clock and matching ticks."""

    def __init__(self, start_s: float = 0.0) -> None:
        self.clock = ManualClock(start_s)
        self.board = Blackboard(self.clock, MISSION_KEYS)
        self.index = 0

    def tick(
        self,
        *,
        pose: Pose | None = None,
        yaw_rad: float = 0.0,
        command: Command = HOVER,
        phase: str = "explore",
        frame: bool = True,
        **changes: Any,
    ) -> TickRecord:
        """Return the next tick, 0.1 s after the last one."""
        time_s = self.clock.now()
        state = DroneState(
            captured_s=time_s,
            flying=FlyingState.FLYING,
            attitude=Attitude(yaw_rad=yaw_rad),
            height_above_ground_m=1.5,
            gimbal_pitch_rad=-0.5,
        )
        told: dict[str, Any] = {
            "index": self.index,
            "time_s": time_s,
            "observation": Observation(
                frame=blank_frame(CAMERA, state) if frame else None, state=state
            ),
            "tree_status": Status.RUNNING,
            "phase": phase,
            "active": ("mission", "leaf"),
            "command": command,
            "proposed_by": None,
            "override": None,
            "compute_s": 0.004,
            "truth": None if pose is None else truth(time_s, pose),
            "feedback": "clear",
        }
        self.index += 1
        self.clock.advance(0.1)
        return TickRecord(**{**told, **changes})


def truth(time_s: float, pose: Pose) -> Truth:
    return Truth(
        time_s=time_s,
        pose=pose,
        contacts=(),
        clearance_m=0.8,
        inside_ground=True,
        on_mark=False,
        landing_error_m=2.0,
        motors_on=True,
    )
