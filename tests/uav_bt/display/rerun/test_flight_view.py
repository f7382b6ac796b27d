"""The view of a flight: what is drawn where, when it is drawn again, and what is taken away."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import cv2
import numpy as np
import pytest

from tests.paper_lab import BOXES, CARPET, CLASSES, paper_map
from tests.uav_bt.display.display_world import World, facts
from tests.uav_bt.display.test_maps import believed
from tests.worlds.values import corridor
from uav_bt.board import CLASS_MAP, CORRIDOR, MARK, METRIC_DEPTH, SITE_MAP
from uav_bt.mission.safety import Override
from uav_bt.mission.tick import TickRecord
from uav_bt.tree import Status
from uav_bt.types import ClassMap, DepthMap, MarkFix, NearObstacles, Pose

NODES = (
    ("Main/root", "root"),
    ("Main/root/first", "first"),
    ("Main/root/second", "second"),
    ("Main/root/second/leaf", "leaf"),
)
AHEAD = MarkFix(captured_s=0.0, forward_m=1.0, right_m=1.0, height_m=0.4, detected=True)


class Noted(NamedTuple):
    entity: str
    thing: Any
    static: bool
    time_s: float | None


class NotedStream:
    """Replaces a `rerun.RecordingStream`."""

    def __init__(self) -> None:
        self.notes, self.names, self.blueprints = list[Noted](), list[str](), list[Any]()
        self.time_s: float | None = None
        self.send_recording_name = self.names.append
        self.send_blueprint = self.blueprints.append

    def log(self, entity: str, thing: Any, *, static: bool = False) -> None:
        self.notes.append(Noted(entity, thing, static, self.time_s))

    def set_time(self, timeline: str, *, duration: float) -> None:
        assert timeline == "flight"
        self.time_s = duration

    def set_log_time_enabled(self, enabled: object) -> None:
        assert not enabled

    set_log_tick_enabled = set_log_time_enabled

    def of(self, entity: str, *, static: bool = False) -> list[Noted]:
        """Return what was drawn at an entity, or what stays there."""
        return [note for note in self.notes if note.entity == entity and note.static is static]

    def last(self, entity: str, *, static: bool = False) -> Any:
        return self.of(entity, static=static)[-1].thing

    def kinds(self, entity: str) -> list[str]:
        return [type(note.thing).__name__ for note in self.of(entity)]


def values(batch: Any) -> list[Any]:
    """Return the values of a component of an archetype."""
    plain: list[Any] = batch.as_arrow_array().to_pylist()
    return plain


def pose(x_m: float = 0.0, yaw_rad: float = 0.0) -> Pose:
    return Pose(x_m=x_m, y_m=0.0, z_m=1.5, yaw_rad=yaw_rad)


class Flight:
    """A view of a flight."""

    def __init__(self, **changes: Any) -> None:
        from uav_bt.display.rerun.flight_view import FlightView

        self.stream, self.world = NotedStream(), World(start_s=40.0)
        self.statuses = {"Main/root": Status.RUNNING, "Main/root/first": Status.FAILURE}
        stream: Any = self.stream
        told = facts(**{"nodes": NODES, "makes_depth": True, **changes})
        self.view = FlightView(stream, told, self.world.board, lambda: self.statuses)

    def fly(self, at: Pose | None = None, **changes: Any) -> TickRecord:
        record = self.world.tick(pose=at or pose(), **changes)
        self.view.on_tick(record)
        return record

    def class_map(self) -> ClassMap:
        ids = np.zeros((18, 32), dtype=np.uint8)
        ids[9:] = CARPET
        ids[4:12, 10:20] = BOXES[0]
        return paper_map(ids, self.world.clock.now())

    def depth(self) -> DepthMap:
        metres = np.full((18, 32), 1.5, np.float32)
        metres[0] = np.nan
        return DepthMap(depth=metres, metric=True, captured_s=self.world.clock.now())

    def image(self) -> np.ndarray:
        blob = np.asarray(values(self.stream.last("world/camera/image").blob)[0], dtype=np.uint8)
        return cv2.imdecode(blob, cv2.IMREAD_COLOR)[:, :, ::-1].astype(int)

    def curve(self, name: str) -> float:
        (value,) = values(self.stream.last(f"plots/{name}").scalars)
        return float(value)


@pytest.mark.parametrize(("start_s", "first_s"), [(None, 0.0), (30.0, 10.0)])
def test_time_begins_with_the_first_tick_or_as_given(start_s: float | None, first_s: float) -> None:
    flight = Flight(start_s=start_s)
    for _ in range(2):
        flight.fly()
    times = [note.time_s for note in flight.stream.of("plots/tick_time/compute")]
    assert times == pytest.approx([first_s, first_s + 0.1])
    assert flight.stream.names == ["tour"]


def test_texts_are_logged_when_they_change_and_overrides_warn() -> None:
    flight = Flight()
    for override in (None, None, Override.STALE_FRAME):
        flight.fly(override=override)
    said = flight.stream.of("words")
    assert [values(note.thing.level) for note in said] == [["INFO"], ["WARN"]]
    assert values(said[0].thing.text) == ["explore: Explore (clear): hover"]
    assert Override.STALE_FRAME.value in values(said[1].thing.text)[0]


def test_the_path_grows_by_a_piece_a_tick() -> None:
    flight = Flight()
    for x_m in (0.0, 0.5, 1.0):
        flight.fly(pose(x_m))
    pieces = [values(note.thing.strips)[0] for note in flight.stream.of("world/path")]
    assert pieces == [[[0.0, 0.0, 1.5], [0.5, 0.0, 1.5]], [[0.5, 0.0, 1.5], [1.0, 0.0, 1.5]]]


@pytest.mark.parametrize(("yaw_rad", "pitch_rad"), [(0.0, 0.0), (1.0, -0.5), (-2.5, -math.pi / 2)])
def test_the_camera_looks_level_along_yaw_and_pitch(yaw_rad: float, pitch_rad: float) -> None:
    from uav_bt.display.rerun.flight_view import camera_axes

    right, down, ahead = camera_axes(yaw_rad, pitch_rad).T
    level = np.array([math.cos(yaw_rad), math.sin(yaw_rad), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    expected = math.cos(pitch_rad) * level + math.sin(pitch_rad) * up
    np.testing.assert_allclose(ahead, expected, atol=1e-12)
    np.testing.assert_allclose(right, np.cross(level, up), atol=1e-12)
    np.testing.assert_allclose(down, np.cross(ahead, right), atol=1e-12)


def test_an_image_is_drawn_once_and_none_before_the_first() -> None:
    flight = Flight()
    flight.fly(frame=False)
    record = flight.fly()
    flight.view.on_tick(replace(record, time_s=record.time_s + 0.1))
    (image,) = flight.stream.of("world/camera/image")
    assert image.time_s == pytest.approx(0.1)


def marked(*_: object) -> np.ndarray:
    inside = np.zeros((18, 32), dtype=bool)
    inside[5:9, 3:9] = True
    return inside


def test_classes_are_outlined_and_what_is_inside_the_corridor_in_its_own_frame() -> None:
    flight = Flight(intruding=marked)
    flight.fly()
    plain, board = flight.image(), flight.world.board
    for late_s in (0.0, 0.1):
        now_s = flight.world.clock.now()
        board.write(CLASS_MAP, flight.class_map(), captured_s=now_s)
        board.write(METRIC_DEPTH, flight.depth(), captured_s=now_s)
        board.write(CORRIDOR, corridor(1.5, "left", nearest_m=0.6), captured_s=now_s)
        flight.world.clock.advance(late_s)
        flight.fly()
        red = (flight.image() - plain)[100:180, 50:70]  # its left edge
        assert ((red[..., 0] - red[..., 2]).max() > 60) == (late_s == 0.0)
        edge = (flight.image() - plain)[150:230, 196:205]  # of the box
        assert np.abs(edge).max() > 60


def test_masks_and_depth_are_drawn_when_new_and_taken_away_when_old() -> None:
    flight = Flight()
    board = flight.world.board
    flight.fly()
    board.write(CLASS_MAP, flight.class_map())
    board.write(METRIC_DEPTH, flight.depth())
    flight.fly()
    flight.fly()
    board.forget(CLASS_MAP)
    board.forget(METRIC_DEPTH)
    flight.fly()
    assert flight.stream.kinds("mask/ids") == ["SegmentationImage", "Clear"]
    assert flight.stream.kinds("world/depth/metres") == ["DepthImage", "Clear"]
    image = flight.stream.of("world/depth/metres")[0].thing
    assert values(image.meter) == [1.0]
    metres = np.frombuffer(bytes(values(image.buffer)[0]), np.float16).reshape(18, 32)
    assert np.isnan(metres[0]).all()
    assert (metres[1:] == 1.5).all()


def test_classes_and_the_lab_are_drawn_once() -> None:
    stream = Flight().stream
    context = stream.last("mask", static=True).context
    shown = [entry["class_description"]["info"] for entry in values(context)[0]]
    assert [info["label"] for info in shown] == list(CLASSES.names)
    assert [info["color"] >> 8 for info in shown] == [
        int(red) << 16 | int(green) << 8 | int(blue) for red, green, blue in CLASSES.colours
    ]
    things = values(stream.last("world/lab/things", static=True).centers)
    np.testing.assert_allclose(things, [[1.0, 1.0, 0.95], [-1.5, -1.0, 0.2]], atol=1e-6)
    unknown = Flight(lab_map=None).stream
    assert not [note for note in unknown.notes if note.entity.startswith("world/lab")]


def test_the_site_map_is_an_image_twice_a_second() -> None:
    flight = Flight(makes_map=True)
    for index in range(12):
        if index:
            flight.world.board.write(SITE_MAP, believed())
        flight.fly()
    images = flight.stream.of("site_map")
    assert len(images) == 3, "from the second tick on, every fifth"
    blob = np.asarray(values(images[-1].thing.blob)[0], dtype=np.uint8)
    image = cv2.imdecode(blob, cv2.IMREAD_COLOR)
    assert image.shape == (520, 640, 3)
    assert image.std() > 5.0, "it shows something"


def test_each_curve_has_a_point_a_tick_and_a_gap_where_it_is_unknown() -> None:
    flight = Flight()
    flight.view.on_tick(flight.world.tick(yaw_rad=0.5))
    for name in ("heading/mark", "height/true", "free_distance/ahead", "free_distance/clearance"):
        assert math.isnan(flight.curve(name))
    now_s = flight.world.clock.now()
    ahead = corridor(1.2, "front", nearest_m=0.7, captured_s=now_s)
    flight.world.board.write(CORRIDOR, ahead, captured_s=now_s)
    near = NearObstacles(points_m=np.array([[0.3, 0.4]]), captured_s=0.0)
    flight.world.board.write(SITE_MAP, believed(near=near))
    flight.world.board.write(MARK, AHEAD)
    flight.fly()
    expected = {
        "heading/telemetry": 0.0,
        "heading/mark": 45.0,
        "height/telemetry": 1.5,
        "height/true": 1.5,
        "free_distance/ahead": 1.2,
        "free_distance/intrusion": 0.7,
        "free_distance/remembered": 0.5,
        "free_distance/clearance": 0.8,
        "tick_time/compute": 1.0,
    }
    assert {name: flight.curve(name) for name in expected} == pytest.approx(expected)
    drawn = [note.entity for note in flight.stream.notes if note.entity.startswith("plots")]
    assert set(drawn) == {f"plots/{name}" for name in expected}


def test_the_tree_has_the_signs_of_its_statuses_and_is_drawn_when_one_changes() -> None:
    flight = Flight()
    for status in (Status.FAILURE, Status.FAILURE, Status.SUCCESS):
        flight.statuses["Main/root/first"] = status
        flight.fly()
    (first,), (second,) = (values(note.thing.text) for note in flight.stream.of("tree"))
    assert first.splitlines() == ["▶ root", "    ✘ first", "    · second", "        · leaf"]
    assert second.splitlines()[1] == "    ✔ first"


def views(part: object) -> list[str]:
    """Return the names of the views of a layout."""
    from rerun.blueprint import View

    if isinstance(part, View):
        return [str(part.name)]
    return [name for below in getattr(part, "contents", None) or () for name in views(below)]


@pytest.mark.parametrize("has_them", [True, False])
def test_the_layout_has_panes_of_what_the_mission_makes(*, has_them: bool) -> None:
    stream = Flight(makes_depth=has_them, makes_map=has_them).stream
    (blueprint,) = stream.blueprints
    assert views(blueprint.root_container) == [
        *("Camera", "Mask", *(["Metric depth"] * has_them)),
        *("tour", *(["Site map"] * has_them), "Words", "Tree"),
        *("Heading, deg", "Height, m", "Free distance, m", "Tick time, ms"),
    ]
