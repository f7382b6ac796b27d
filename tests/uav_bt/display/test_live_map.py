"""The live map of a flight."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.paper_lab import CLASSES
from tests.uav_bt.display.display_world import CAMERA, LAB, World
from uav_bt.display.flown_path import FlownPath
from uav_bt.display.lab_map import HEADER_PX, MapFrame, MapItem, MapMover, phase_colours
from uav_bt.display.live_map import LiveMap, ground_view
from uav_bt.display.site_map_pane import FOOTER_PX, OUTSIDE, PASSED, SEEN, cells_image
from uav_bt.types import MarkFix, MoverState, Pose, Pose2D
from uav_bt.types.site_map import MapObject, SiteMap

SIZE_PX = (638, 439)
FRAME = MapFrame.around(LAB.ground_size_m, SIZE_PX, header_px=HEADER_PX, footer_px=FOOTER_PX)


def test_a_camera_that_looks_straight_down_sees_a_rectangle_below_the_lens() -> None:
    corners = ground_view(CAMERA, -math.pi / 2, 1.5, reach_m=9.0)
    forward = [point[0] - CAMERA.forward_offset_m for point in corners]
    right = [point[1] for point in corners]
    half_high, half_wide = (1.5 * n / 2 / CAMERA.fx_px for n in (CAMERA.height_px, CAMERA.width_px))
    assert forward == pytest.approx([half_high, half_high, -half_high, -half_high])
    assert right == pytest.approx([-half_wide, half_wide, half_wide, -half_wide])


def test_rays_that_never_come_down_end_at_the_reach() -> None:
    for forward, right in ground_view(CAMERA, 0.9, 1.5, reach_m=2.0):
        assert math.hypot(forward - CAMERA.forward_offset_m, right) == pytest.approx(2.0)


def test_the_path_stays_on_the_map_while_the_drone_moves_on() -> None:
    world, flown, live = World(), FlownPath(), LiveMap(LAB, CAMERA, SIZE_PX)
    for x in np.linspace(-1.0, 1.0, 9):
        flown.add(world.tick(pose=Pose(x_m=float(x), y_m=0.0, z_m=1.5, yaw_rad=0.0)))
        image = live.draw(flown, pitch_rad=-0.5, height_m=1.5, fix=None)
    column, row = (round(v) for v in FRAME.to_px(-0.6, 0.0))
    assert tuple(image[row, column]) == phase_colours(["explore"])["explore"]


def test_what_moves_is_drawn_where_it_is() -> None:
    item = MapItem(x_m=-1.0, y_m=1.2, size_m=(0.4, 0.4, 1.7), colour=(10, 20, 30))
    mover = MapMover(item=item, path_m=((-1.0, 1.2), (1.0, 1.2)), round=True)
    live = LiveMap(replace(LAB, movers=(mover,)), CAMERA, SIZE_PX)
    flown, world = FlownPath(), World()
    at = {x: tuple(round(v) for v in FRAME.to_px(x, 1.2)) for x in (-1.0, 0.5)}
    image = live.draw(flown, pitch_rad=-0.5, height_m=1.5, fix=None)
    assert tuple(image[at[-1.0][1], at[-1.0][0]]) == (10, 20, 30), "where its path begins"
    record = world.tick(pose=Pose(x_m=0.0, y_m=-1.5, z_m=1.5, yaw_rad=-1.5))
    assert record.truth is not None
    moved = MoverState(
        name="mover-1",
        pose=Pose(x_m=0.5, y_m=1.2, z_m=0.85, yaw_rad=0.0),
        vx_mps=0.5,
        vy_mps=0.0,
    )
    flown.add(replace(record, truth=replace(record.truth, movers=(moved,))))
    image = live.draw(flown, pitch_rad=-0.5, height_m=1.5, fix=None)
    assert tuple(image[at[0.5][1], at[0.5][0]]) == (10, 20, 30)
    assert tuple(image[at[-1.0][1], at[-1.0][0]]) != (10, 20, 30)


def test_the_camera_view_lies_where_the_drone_looks() -> None:
    """Yaw is counter-clockwise: the view of a drone with heading +y is above it on the map."""
    world, flown, live = World(), FlownPath(), LiveMap(LAB, CAMERA, SIZE_PX)
    empty = live.draw(flown, pitch_rad=-0.5, height_m=1.5, fix=None)
    flown.add(world.tick(pose=Pose(x_m=0.0, y_m=-0.5, z_m=1.5, yaw_rad=math.pi / 2)))
    image = live.draw(flown, pitch_rad=-0.5, height_m=1.5, fix=None)
    changed = {}
    for name, point in (("ahead", (0.0, 0.6)), ("behind", (0.0, -1.4)), ("right", (1.2, -0.5))):
        column, row = (round(v) for v in FRAME.to_px(*point))
        changed[name] = tuple(image[row, column]) != tuple(empty[row, column])
    assert changed == {"ahead": True, "behind": False, "right": False}


def test_a_fix_is_marked_where_the_drone_believes_the_mark() -> None:
    world, flown, live = World(), FlownPath(), LiveMap(LAB, CAMERA, SIZE_PX)
    flown.add(world.tick(pose=Pose(x_m=0.0, y_m=0.0, z_m=1.5, yaw_rad=math.pi / 2)))
    fix = MarkFix(captured_s=0.0, forward_m=-1.0, right_m=0.5, height_m=0.4, detected=True)
    image = live.draw(flown, pitch_rad=-0.5, height_m=1.5, fix=fix)
    column, row = (round(v) for v in FRAME.to_px(0.5, -1.0))
    assert tuple(image[row, column]) == (255, 196, 0)


def test_the_title_stands_above_the_lab() -> None:
    plain, titled = (
        LiveMap(LAB, CAMERA, SIZE_PX, title).draw(FlownPath(), pitch_rad=0, height_m=1, fix=None)
        for title in ("", "land_only in train-a, seed 0")
    )
    rows = np.flatnonzero((plain != titled).any(axis=(1, 2)))
    assert rows.size > 0
    assert rows.max() < HEADER_PX


def test_a_flight_in_an_unknown_lab_is_drawn_too() -> None:
    world, flown, live = World(), FlownPath(), LiveMap(None, CAMERA, SIZE_PX)
    flown.add(world.tick())
    assert live.draw(flown, pitch_rad=0.0, height_m=0.0, fix=None).shape == (439, 638, 3)


def believed(x_m: float = 0.0, *objects: MapObject) -> SiteMap:
    """Return a map with ground ahead of the start and to its right only."""
    rows, columns = np.indices((21, 21))
    ahead, right = rows - 10 > 0, columns - 10 > 0
    return SiteMap(
        classes=CLASSES,
        pose=Pose2D(x_m=x_m, y_m=0.0, yaw_rad=0.0),
        corner_m=(-1.0, -1.0),
        cell_m=0.1,
        seen_s=np.where(ahead, 1.0, -np.inf),
        free=ahead,
        outside=~ahead & right,
        passed=ahead & ~right,
        obstacles_m=np.empty((0, 2)),
        edges_m=np.empty((0, 2)),
        captured_s=1.0,
        objects=objects,
    )


def test_cells_are_shown_by_what_is_known_of_them() -> None:
    image = cells_image(believed())
    assert [tuple(image[cell]) for cell in ((15, 15), (15, 5), (5, 15))] == [SEEN, PASSED, OUTSIDE]


def test_the_missions_map_lies_where_the_drone_saw_it() -> None:
    """The drone starts at (0.5, 0) with heading y: x is to its right, and y is ahead."""
    box_2 = MapObject(class_id=5, x_m=0.5, y_m=0.5, size_m=0.3, width_m=0.3, std_m=0.1, seen_s=1.0)
    flown, world, live = FlownPath(), World(), LiveMap(LAB, CAMERA, SIZE_PX)
    pose = Pose(x_m=0.5, y_m=0.0, z_m=1.5, yaw_rad=math.pi / 2)

    def shown(time_s: float, site_map: SiteMap | None) -> np.ndarray:
        flown.add(world.tick(pose=pose))
        live.believe(time_s, flown, 0.0, site_map)
        return live.draw(flown, pitch_rad=-math.pi / 2, height_m=0.01, fix=None)

    def at(image: np.ndarray, x_m: float, y_m: float) -> tuple[int, ...]:
        column, row = (round(v) for v in FRAME.to_px(x_m, y_m))
        return tuple(image[row, column])

    assert at(shown(0.0, None), 1.2, 0.7) not in {SEEN, PASSED, OUTSIDE}
    image = shown(0.1, believed(0.0, box_2))
    assert at(image, 1.3, 0.8) == SEEN
    assert at(image, -0.2, 0.8) == PASSED
    assert at(image, 1.3, -0.8) == OUTSIDE
    assert at(image, 1.0 - 0.15, 0.5) == tuple(CLASSES.colours[5]), "an object's side in its colour"
    assert np.array_equal(shown(0.2, None), image), "the last map stays"
    pose = Pose(x_m=0.5, y_m=0.4, z_m=1.5, yaw_rad=math.pi / 2)
    shown(0.3, believed(0.4))
    image = shown(0.4, believed(0.4))
    assert at(image, 0.5, 0.2) == phase_colours(["explore"])["explore"], "the path lies on top"
