"""The lab in 3D: frames of reference, planes of the corridor, past poses, drawing."""

from __future__ import annotations

import math

import numpy as np
import pytest
import rerun as rr

from tests.uav_bt.display.display_world import World
from tests.uav_bt.display.rerun.rerun_world import NotedStream, setting, values
from tests.worlds.values import corridor
from uav_bt.display.flown_path import FlownPath
from uav_bt.display.lab_map import LabMap, MapItem, MapMover
from uav_bt.display.rerun.setting import CorridorSize
from uav_bt.display.rerun.world import WorldView, camera_axes, corridor_planes
from uav_bt.errors import ValueRangeError
from uav_bt.types import MarkFix, MoverState, NearObstacles, Pose


def pose(x_m: float = 0.0, y_m: float = 0.0, z_m: float = 1.5, yaw_rad: float = 0.0) -> Pose:
    return Pose(x_m=x_m, y_m=y_m, z_m=z_m, yaw_rad=yaw_rad)


def test_a_level_camera_looks_along_the_body_with_down_below() -> None:
    right, down, forward = camera_axes(0.0, 0.0).T
    np.testing.assert_allclose(right, [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(down, [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(forward, [1, 0, 0], atol=1e-12)


@pytest.mark.parametrize("yaw_rad", [0.0, 1.0, -2.5])
@pytest.mark.parametrize("pitch_rad", [0.0, -0.5, -math.pi / 2])
def test_camera_axes_are_a_rotation(yaw_rad: float, pitch_rad: float) -> None:
    axes = camera_axes(yaw_rad, pitch_rad)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_a_gimbal_turned_down_looks_down() -> None:
    forward = camera_axes(0.7, -math.pi / 2)[:, 2]
    np.testing.assert_allclose(forward, [0, 0, -1], atol=1e-12)


def test_corridor_planes_lie_where_the_mission_has_them() -> None:
    planes = corridor_planes(CorridorSize(side_m=0.5, front_m=2.0, up_down_m=0.8))
    assert planes["left"][0] == (1.0, 0.5, 0.0)
    assert planes["right"][0] == (1.0, -0.5, 0.0)
    assert planes["front"][0] == (2.0, 0.0, 0.0)
    assert planes["up"][0] == (1.0, 0.0, 0.8)
    assert planes["down"][0] == (1.0, 0.0, -0.8)


def test_a_corridor_without_room_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="more than 0 m"):
        CorridorSize(side_m=0.0, front_m=2.0, up_down_m=0.8)


def test_the_lab_is_drawn_once_with_boxes_and_mark() -> None:
    stream = NotedStream()
    WorldView(stream, setting())
    (things,) = stream.of("world/lab/things")
    assert things.static
    centres = values(things.thing.centers)
    np.testing.assert_allclose(centres, [[1.0, 1.0, 0.95], [-1.5, -1.0, 0.2]], atol=1e-6)
    assert stream.of("world/lab/h")


def test_an_unknown_lab_is_left_empty() -> None:
    stream = NotedStream()
    WorldView(stream, setting(lab_map=None))
    assert not [note for note in stream.notes if note.entity.startswith("world/lab")]


class Flight:
    """A world view with a flight."""

    def __init__(self) -> None:
        self.stream, self.world, self.flown = NotedStream(), World(), FlownPath()
        self.view = WorldView(self.stream, setting())

    def fly(self, at: Pose, phase: str = "explore") -> None:
        record = self.world.tick(pose=at, phase=phase)
        self.flown.add(record)
        self.view.show_drone(record.time_s, self.flown)
        self.view.show_lens(record.observation.frame)


def test_the_path_grows_by_a_piece_a_tick() -> None:
    flight = Flight()
    for x_m in (0.0, 0.5, 1.0):
        flight.fly(pose(x_m=x_m))
    pieces = [values(note.thing.strips)[0] for note in flight.stream.of("world/path")]
    assert pieces == [[[0.0, 0.0, 1.5], [0.5, 0.0, 1.5]], [[0.5, 0.0, 1.5], [1.0, 0.0, 1.5]]]


def test_the_lens_sits_ahead_of_the_bodys_centre() -> None:
    flight = Flight()
    flight.fly(pose(yaw_rad=math.pi / 2))
    ahead_m = setting().camera.forward_offset_m
    placed = flight.stream.last("world/camera")
    np.testing.assert_allclose(values(placed.translation)[0], [0.0, ahead_m, 1.5], atol=1e-6)


def test_what_moves_is_drawn_where_it_is() -> None:
    item = MapItem(x_m=0.0, y_m=0.0, size_m=(0.4, 0.4, 1.7))
    movers = tuple(
        MapMover(item=item, path_m=((0.0, 0.0), (1.0, 0.0)), round=is_round)
        for is_round in (True, False)
    )
    stream = NotedStream()
    view = WorldView(stream, setting(lab_map=LabMap(ground_size_m=(5.0, 4.0), movers=movers)))
    view.show_movers(
        [
            MoverState(name=name, pose=pose(x_m=x_m, z_m=0.85), vx_mps=0.5, vy_mps=0.0)
            for name, x_m in (("mover-1", 0.25), ("mover-2", 0.75))
        ]
    )
    for name, x_m, kind in (("mover-1", 0.25, rr.Cylinders3D), ("mover-2", 0.75, rr.Boxes3D)):
        placed, shape = stream.of(f"world/lab/{name}")[-1].things
        np.testing.assert_allclose(values(placed.translation)[0], [x_m, 0.0, 0.85], atol=1e-6)
        assert isinstance(shape, kind)


def test_the_intruded_plane_stands_out() -> None:
    flight = Flight()
    flight.fly(pose())
    flight.view.show_corridor(corridor(1.0, "left", nearest_m=0.6))
    boxes = flight.stream.of("world/corridor")[-1].things[1]
    colours = values(boxes.colors)
    assert len(colours) == 5
    assert len(set(colours[1:])) == 1
    assert colours[0] != colours[1]  # the left one


def test_a_corridor_that_is_gone_is_taken_away() -> None:
    flight = Flight()
    flight.fly(pose())
    flight.view.show_corridor(corridor(1.0, nearest_m=0.6))
    flight.view.show_corridor(None)
    flight.view.show_corridor(None)
    assert [type(n.thing).__name__ for n in flight.stream.of("world/corridor")] == [
        "Transform3D",
        "Clear",
    ]


def test_remembered_points_lie_where_the_drone_believes_them() -> None:
    flight = Flight()
    flight.fly(pose(x_m=1.0, yaw_rad=math.pi / 2))  # heading +y; +x is to the right
    points = NearObstacles(
        points_m=np.array([[2.0, 0.5]]), edges_m=np.array([[1.0, 0.0]]), captured_s=0.0
    )
    fix = MarkFix(captured_s=0.0, forward_m=1.0, right_m=0.0, height_m=0.4, detected=True)
    flight.view.show_near(points, fix)
    shown = flight.stream.last("world/obstacles")
    seen = values(shown.positions)
    np.testing.assert_allclose(seen, [[1.5, 2.0, 0.0], [1.0, 1.0, 0.0]], atol=1e-6)
    of_an_obstacle, of_an_edge = values(shown.colors)
    assert of_an_obstacle != of_an_edge
    mark = values(flight.stream.last("world/mark_fix").positions)
    np.testing.assert_allclose(mark, [[1.0, 1.0, 0.0]], atol=1e-6)
    flight.view.show_near(None, None)
    for entity in ("world/obstacles", "world/mark_fix"):
        assert type(flight.stream.last(entity)).__name__ == "Clear"
