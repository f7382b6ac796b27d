"""A recording stream that stores its calls, and the facts of a small flight."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from tests.uav_bt.display.display_world import facts
from uav_bt.display.shown import FlightFacts
from uav_bt.lab.classes import LabClass, LabClasses

CLASSES = LabClasses(
    [
        LabClass(name="wall", role="outside", colour=(40, 40, 48)),
        LabClass(name="floor", role="ground", colour=(126, 158, 120)),
        LabClass(name="drum", role="obstacle", colour=(214, 39, 40)),
    ]
)
NODES = (
    ("Main/root", "root"),
    ("Main/root/first", "first"),
    ("Main/root/second", "second"),
    ("Main/root/second/leaf", "leaf"),
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
    blueprints: list[Any] = field(default_factory=list)
    time_s: float | None = None

    def __post_init__(self) -> None:
        self.send_recording_name = self.names.append
        self.send_blueprint = self.blueprints.append

    def log(self, entity: str, *things: Any, static: bool = False) -> None:
        self.notes.append(Noted(entity, things, static, self.time_s))

    def set_time(self, timeline: str, *, duration: float) -> None:
        assert timeline == "flight"
        self.time_s = duration

    def set_log_time_enabled(self, enabled: object) -> None:
        assert not enabled

    set_log_tick_enabled = set_log_time_enabled

    def of(self, entity: str) -> list[Noted]:
        """Return what was drawn at an entity, without what stays."""
        return [note for note in self.notes if note.entity == entity and not note.static]

    def last(self, entity: str) -> Any:
        return self.of(entity)[-1].thing

    def kinds(self, entity: str) -> list[str]:
        return [type(note.thing).__name__ for note in self.of(entity)]

    def constant(self, entity: str) -> Any:
        (note,) = [note for note in self.notes if note.entity == entity and note.static]
        return note.thing


def values(batch: Any) -> list[Any]:
    """Return the values of a component of an archetype."""
    plain: list[Any] = batch.as_arrow_array().to_pylist()
    return plain


def noted_facts(**changes: Any) -> FlightFacts:
    return facts(**{"classes": CLASSES, "nodes": NODES, "makes_depth": True, **changes})
