"""Exactness of the twin's images, checked by independent geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.model import build_model
from sim_bridge.twin.objects import Helipad
from sim_bridge.twin.render import Renderer
from sim_bridge.twin.scene import CARPET_SIZE_M, Scene
from sim_bridge.twin.scene_file import load_scene
from tests.sim_bridge.twin.lab_world import lens
from uav_bt.errors import ValueRangeError

SIZE = (640, 360)


def bare(mark: Helipad) -> Renderer:
    return Renderer(build_model(Scene(name="bare", helipad=mark)))


@pytest.mark.parametrize("size", [(640, 360), (320, 180), (224, 112), (320, 256)])
def test_ground_corners_appear_where_the_camera_model_projects_them(size: tuple[int, int]) -> None:
    """The corners are within a pixel of their projections, at resized sizes, too."""
    camera = anafi_camera(640, 360).resized(*size)
    with bare(Helipad(position_m=(0.0, 0.0), size_m=(0.1, 0.1, 0.05))) as renderer:
        ids = renderer.class_ids(lens(0.0, 0.0, 4.0, 0.0, -90.0), *size)
    rows, columns = np.nonzero(ids == 1)
    # Looking straight down with the heading along x, the image's right is -y and its top +x.
    right = camera.cx_px + camera.fx_px * CARPET_SIZE_M[1] / 2 / 4.0
    assert columns.max() + 0.5 == pytest.approx(right, abs=1.0)
    assert columns.min() - 0.5 == pytest.approx(2 * camera.cx_px - right, abs=1.0)
    assert (rows.min(), rows.max()) == (0, size[1] - 1)


def test_the_letter_on_the_pad_is_upright_and_not_mirrored() -> None:
    """From above, facing the pad's +x, the legs of the H are vertical in the image."""
    place = lens(0.0, 0.0, 1.4, 180.0, -90.0)
    with bare(Helipad(position_m=(0.0, 0.0), yaw_deg=90.0)) as renderer:
        panel = renderer.rgb(place, *SIZE)[..., 0] > 150
        ids = renderer.class_ids(place, *SIZE)
    assert set(np.unique(ids)) >= {1, 2, 3}
    rows, columns = np.nonzero(ids == 2)
    row, column = (rows.min() + rows.max()) // 2, (columns.min() + columns.max()) // 2
    above = (columns.max() - columns.min()) // 6
    bar = [panel[row + step, column] for step in (-above, 0, above)]
    assert bar == [False, True, False], "the bar of the H crosses the middle only"


def test_a_renderer_gives_the_same_picture_whatever_it_drew_between_until_it_is_closed() -> None:
    """Rendering other sizes and kinds in between has no effect."""
    renderer, place = Renderer(build_model(load_scene("train-a"))), lens(-1.0, 0.5, 1.5, -30, -27)
    first = renderer.rgb(place, *SIZE)
    renderer.ids_and_depth(lens(0.0, 0.0, 2.5, 90.0, -60.0), 1152, 648)
    assert np.array_equal(renderer.rgb(place, *SIZE), first)
    with pytest.raises(ValueRangeError, match="0x36"):
        renderer.rgb(place, 0, 36)
    renderer.close()
    renderer.close()
    with pytest.raises(ValueRangeError, match="closed"):
        renderer.rgb(place, 64, 36)


def test_the_view_is_that_of_the_anafi() -> None:
    camera = anafi_camera(1280, 720)
    assert 2 * math.degrees(math.atan(640 / camera.fx_px)) == pytest.approx(69.0, abs=0.1)
