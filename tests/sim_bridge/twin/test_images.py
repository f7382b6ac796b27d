"""Images: exact by independent geometry, reproducible, from poses as in flight."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.twin.model import build_model
from sim_bridge.twin.objects import Helipad
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.render import Renderer
from sim_bridge.twin.scene import CARPET_SIZE_M, Scene, TakeOffSpec
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views, sample_flight_poses
from tests.paper_lab import paper_map
from tests.sim_bridge.twin.lab_world import lens
from tests.sim_bridge.twin.room_world import LAB, START, body_in, scene_of
from tests.worlds import values
from uav_bt.errors import ValueRangeError
from uav_bt.landing_marks import MarkView
from uav_bt.plugins import make_mark_finder

SIZE, SMALL = (640, 360), (160, 90)
SCENE = load_scene("test-a")
KINDS = {
    "apriltag": {"family": "25h9", "id": 3, "size_m": 0.35},
    "aruco": {"id": 3, "size_m": 0.35},
    "region": {},
    "helipad": {},
}


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


def test_the_ground_is_brighter_below_a_lamp(hall: Path) -> None:
    with Renderer(build_model(scene_of(hall, START))) as renderer:
        below, beyond = (
            renderer.rgb(lens(x_m, 0.0, 1.0, 0.0, -90.0), *SMALL).mean() for x_m in (-2.0, 2.0)
        )
    assert below > 1.3 * beyond


def test_classes_are_exact_with_more_surfaces_than_one_byte_counts(hall: Path) -> None:
    (hall / "lab.yaml").write_text(LAB.replace("size_m: [6, 4]", "size_m: [20, 20]"))
    text = "objects:\n" + "".join(
        f"  - {{kind: drum, position_m: [{-8 + 1.2 * k:.1f}, {-7 + 1.2 * row:.1f}]}}\n"
        for row in range(12)
        for k in range(12)
    )
    scene = scene_of(hall, f"{text}take_off: {{from: [-9.0, -9.0]}}\n")
    lab = build_model(scene)
    assert (lab.model.geom_group == 0).sum() > 256
    x_m, y_m = scene.placed[-1].spec.position_m
    with Renderer(lab) as renderer:
        ids = renderer.class_ids(lens(x_m - 1.0, y_m, 1.6, 0.0, -40.0), *SMALL)
    assert {4, 6} <= set(np.unique(ids).tolist()) <= {0, 1, 4, 6}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("height_m", [0.0, 0.5])
def test_each_kind_is_found_where_it_stands(kind: str, height_m: float) -> None:
    """Two views: from straight above, and from 1.5 m to the south with the drone looking north."""
    size_m, place_m = (0.5, 0.5, height_m), (0.6, -0.4)
    mark = Helipad(position_m=place_m, yaw_deg=20.0, size_m=size_m, kind=kind, options=KINDS[kind])
    poses = [lens(0.6, -0.4, 1.5, 90.0, -90.0), lens(0.6, -1.9, 1.5, 90.0, -40.0)]
    finder, camera = make_mark_finder(mark.mark), anafi_camera(640, 360)
    scene = Scene(name="mark", helipad=mark)
    lab = build_model(scene, drawn=False)
    touched = {lab.contact_name(geom) for geom in range(lab.model.ngeom)}
    assert ("mark" in touched) == (height_m > 0.0), "on a mat the drone stands on the ground"
    views = render_views(scene, poses, truth_size_px=(224, 112))
    for pose, view, ahead_m in zip(poses, views, (0.0, 1.5), strict=True):
        frame = values.frame(view.image, pose.pitch_rad, 1.5)
        class_map = paper_map(ids=view.ids, captured_s=0.0)
        seen = finder.find(MarkView(frame=frame, camera=camera, class_map=class_map))
        assert seen is not None
        place = (seen.forward_m - CAMERA_FORWARD_M, seen.right_m, seen.height_m)
        assert place == pytest.approx((ahead_m, 0.0, height_m), abs=0.04)
        if finder.shows_heading:  # the upper edge is 20 degrees counter-clockwise from north
            assert seen.heading_deg == pytest.approx(20.0, abs=0.5)


@pytest.mark.parametrize("name", ["test-a", "depot-val-a"])
def test_sampled_poses_are_where_a_drone_could_be(name: str) -> None:
    """Poses are above the ground, clear of boxes, at flight height, with pitches as in flight."""
    scene = load_scene(name)
    poses, body = sample_flight_poses(scene, np.random.default_rng(0), 210), body_in(scene)
    for pose in poses:
        x_m, y_m = pose.to_world(-CAMERA_FORWARD_M, 0.0)
        body.place(x_m, y_m, pose.z_m, pose.yaw_rad)
        assert body.contacts() == ()
        assert body.clearance_m() > 0.1
        assert scene.ground.contains(x_m, y_m)
        assert 0.6 < pose.z_m < 2.1
    ahead = [pose for pose in poses if pose.pitch_rad > math.radians(-32.0)]
    assert len(ahead) == 180
    assert np.median([pose.z_m for pose in ahead]) == pytest.approx(1.5, abs=0.03)
    assert sum(pose.pitch_rad < math.radians(-54.0) for pose in poses) == 30
    bare = replace(scene, helipad=None, take_off=TakeOffSpec(random=True))
    flat = sample_flight_poses(bare, np.random.default_rng(0), 14)
    assert all(pose.pitch_rad > -0.9 for pose in flat), "no pose looks down at a mark"


def test_a_share_of_the_cameras_is_lowered_and_nothing_else_changes() -> None:
    rngs = [(np.random.default_rng(0), share) for share in (0.0, 0.5)]
    usual, drawn = (sample_flight_poses(SCENE, rng, 210, lowered=share) for rng, share in rngs)
    for one, other in zip(usual, drawn, strict=True):
        assert replace(one, pitch_rad=0.0) == replace(other, pitch_rad=0.0)
    lowered = [index for index in range(210) if drawn[index] != usual[index]]
    assert 70 < len(lowered) < 110
    assert all(index % 7 != 6 for index in lowered), "views of the landing are as they were"
    assert all(-60.0 <= math.degrees(drawn[index].pitch_rad) <= -31.0 for index in lowered)


def test_views_repeat_and_vary_with_the_seed() -> None:
    """The same seed gives the same bytes; it sets light and noise, but not the truth."""
    poses = sample_flight_poses(SCENE, np.random.default_rng(1), 3)
    how: Any = {"size_px": SMALL, "profile": Profile.named("lab"), "vary_light": True}
    views = [render_views(SCENE, poses, seed=seed, **how) for seed in (3, 3, 4)]
    for one, same, changed in zip(*views, strict=True):
        assert np.array_equal(one.image, same.image)
        assert not np.array_equal(one.image, changed.image)
        assert np.array_equal(one.ids, changed.ids)
        assert np.array_equal(one.depth, changed.depth)


def test_clean_views_have_no_noise_and_truth_of_its_own_size() -> None:
    """Without a profile the image is clean; ids and depth have the requested size."""
    poses = sample_flight_poses(SCENE, np.random.default_rng(2), 1)
    (clean,) = render_views(SCENE, poses, size_px=SMALL, truth_size_px=(112, 56))
    (noisy,) = render_views(SCENE, poses, size_px=SMALL, profile=Profile.named("harsh"))
    assert (clean.image.shape, clean.pose) == ((90, 160, 3), poses[0])
    assert clean.ids.shape == clean.depth.shape == (56, 112)
    assert 3.0 < np.abs(noisy.image.astype(float) - clean.image).mean() < 25.0
