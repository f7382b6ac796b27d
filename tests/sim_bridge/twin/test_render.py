"""Exactness of the twin's images, checked by independent geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_bridge.anafi import anafi_camera
from sim_bridge.twin import textures
from sim_bridge.twin.model import build_model
from sim_bridge.twin.objects import Helipad
from sim_bridge.twin.render import Renderer
from sim_bridge.twin.scene import CARPET_SIZE_M, Scene
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import CameraPose
from uav_bt.errors import ValueRangeError

SIZE = (640, 360)


def pose(x: float, y: float, z: float, yaw_deg: float, pitch_deg: float) -> CameraPose:
    return CameraPose(
        x_m=x,
        y_m=y,
        z_m=z,
        yaw_rad=math.radians(yaw_deg),
        pitch_rad=math.radians(pitch_deg),
    )


@pytest.mark.parametrize("size", [(640, 360), (320, 180), (224, 112), (320, 256)])
def test_ground_corners_appear_where_the_camera_model_projects_them(size: tuple[int, int]) -> None:
    """The corners are within a pixel of their projections, at resized sizes, too."""
    scene = Scene(name="bare", helipad=Helipad(position_m=(0.0, 0.0), size_m=(0.1, 0.1, 0.05)))
    camera = anafi_camera(640, 360).resized(*size)
    place = pose(0.0, 0.0, 4.0, 0.0, -90.0)
    with Renderer(build_model(scene)) as renderer:
        ids = renderer.class_ids(place, *size)
    rows, columns = np.nonzero(ids == 1)
    # Looking straight down with the heading along x, the image's right is -y and its top +x.
    right = camera.cx_px + camera.fx_px * CARPET_SIZE_M[1] / 2 / 4.0
    assert columns.max() + 0.5 == pytest.approx(right, abs=1.0)
    assert columns.min() - 0.5 == pytest.approx(2 * camera.cx_px - right, abs=1.0)
    assert (rows.min(), rows.max()) == (0, size[1] - 1)


def test_a_larger_ground_is_the_same_weave_at_the_same_scale() -> None:
    """The number of motifs per metre and the similarity of neighbouring pixels are the same."""
    paper, hall = (textures.carpet(size) for size in ((5.0, 4.0), (10.0, 10.0)))
    assert (paper.shape, hall.shape) == ((1024, 1280, 3), (2560, 2560, 3))
    for shift in (1, 8, 64):
        alike = [
            np.corrcoef(image[:, shift:, 0].ravel(), image[:, :-shift, 0].ravel())[0, 1]
            for image in (paper, hall)
        ]
        assert alike[0] == pytest.approx(alike[1], abs=0.06)


def test_a_known_ground_point_has_the_depth_of_its_projection() -> None:
    """A point on the ground 2 m ahead equals the back-projection of its pixel and depth."""
    scene = Scene(name="bare", helipad=Helipad(position_m=(-2.0, -1.5)))
    camera, place = anafi_camera(*SIZE), pose(-1.0, 0.0, 1.5, 0.0, -27.0)
    axis, up = (np.array(v) for v in place.axes())
    right = np.cross(axis, up)
    point = np.array((1.0, 0.3, 0.0)) - (place.x_m, place.y_m, place.z_m)
    z = point @ axis
    u = camera.cx_px + camera.fx_px * (point @ right) / z
    v = camera.cy_px - camera.fy_px * (point @ up) / z
    with Renderer(build_model(scene)) as renderer:
        ids, depth = renderer.ids_and_depth(place, *SIZE)
    row, column = round(v), round(u)
    assert ids[row, column] == 1
    ray = axis + right * (column - camera.cx_px) / camera.fx_px
    ray = ray - up * (row - camera.cy_px) / camera.fy_px
    landed = place.z_m + depth[row, column] * ray[2]
    assert landed == pytest.approx(0.0, abs=1e-3)
    assert depth[row, column] == pytest.approx(z, abs=0.02)


def test_the_letter_on_the_pad_is_upright_and_not_mirrored() -> None:
    """From above, facing the pad's +x, the legs of the H are vertical in the image."""
    scene = Scene(name="bare", helipad=Helipad(position_m=(0.0, 0.0), yaw_deg=90.0))
    with Renderer(build_model(scene)) as renderer:
        image = renderer.rgb(pose(0.0, 0.0, 1.4, 180.0, -90.0), *SIZE)
        ids = renderer.class_ids(pose(0.0, 0.0, 1.4, 180.0, -90.0), *SIZE)
    panel = image[..., 0] > 150
    assert set(np.unique(ids)) >= {1, 2, 3}
    rows, columns = np.nonzero(ids == 2)
    middle = (rows.min() + rows.max()) // 2, (columns.min() + columns.max()) // 2
    width = columns.max() - columns.min()
    assert panel[middle], "the bar of the H crosses the middle"
    assert not panel[middle[0] - width // 6, middle[1]], "above the bar the panel is dark"
    assert not panel[middle[0] + width // 6, middle[1]]


def test_pictures_of_one_view_are_the_same_whatever_was_drawn_between() -> None:
    """Rendering other sizes and kinds in between has no effect."""
    scene = load_scene("train-a")
    place = pose(-1.0, 0.5, 1.5, -30.0, -27.0)
    with Renderer(build_model(scene)) as renderer:
        first = renderer.rgb(place, *SIZE)
        renderer.ids_and_depth(pose(0.0, 0.0, 2.5, 90.0, -60.0), 1152, 648)
        assert np.array_equal(renderer.rgb(place, *SIZE), first)


def test_anti_aliasing_changes_colours_but_not_ids() -> None:
    """Samples smooth the edges of colours; class ids stay exact."""
    scene = load_scene("train-a")
    place = pose(-1.0, 0.5, 1.5, -30.0, -27.0)
    with Renderer(build_model(scene)) as plain, Renderer(build_model(scene), samples=4) as smooth:
        differing = (plain.class_ids(place, *SIZE) != smooth.class_ids(place, *SIZE)).mean()
        assert differing < 5e-4
        assert not np.array_equal(plain.rgb(place, *SIZE), smooth.rgb(place, *SIZE))


def test_a_closed_renderer_says_so() -> None:
    """Rendering after close is an error; closing twice is not."""
    renderer = Renderer(build_model(load_scene("train-a")))
    renderer.close()
    renderer.close()
    with pytest.raises(ValueRangeError, match="closed"):
        renderer.rgb(pose(0.0, 0.0, 1.5, 0.0, 0.0), 64, 36)


def test_sizes_must_be_positive() -> None:
    """The error of an empty image contains its size."""
    with (
        Renderer(build_model(load_scene("train-a"))) as renderer,
        pytest.raises(ValueRangeError, match="0x36"),
    ):
        renderer.rgb(pose(0.0, 0.0, 1.5, 0.0, 0.0), 0, 36)


@pytest.mark.parametrize(("width", "height"), [(640, 480), (100, 100), (8, 4)])
def test_the_video_is_sixteen_to_nine(width: int, height: int) -> None:
    """The error of a wrong aspect lists valid sizes."""
    with pytest.raises(ValueRangeError, match="640x360"):
        anafi_camera(width, height)


def test_the_view_is_sixty_nine_degrees_wide() -> None:
    """The horizontal field of view is that of the ANAFI."""
    camera = anafi_camera(1280, 720)
    assert 2 * math.degrees(math.atan(640 / camera.fx_px)) == pytest.approx(69.0, abs=0.1)
