"""Scenes in a lab with a room: contacts, ground computations, walls and light."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.model import build_model
from sim_bridge.twin.render import Renderer
from tests.sim_bridge.twin.lab_world import lens
from tests.sim_bridge.twin.room_world import LAB, START, alone, body_in, scene_of, write_lab
from tests.worlds import values
from uav_bt.errors import FileError, SceneError
from uav_bt.mission.covered_ground import CoveredGround, GroundCells
from uav_bt.types import MoverState, Pose


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_lab(tmp_path / "hall")


def test_a_picture_that_is_cut_off_is_refused_when_it_is_drawn(folder: Path) -> None:
    (folder / "wood.png").write_bytes((folder / "wood.png").read_bytes()[:40])
    with pytest.raises(FileError, match=r"wood.png: is a damaged picture"):
        build_model(alone(folder, "crate"))


@pytest.mark.parametrize(
    ("at_m", "below_m", "surface_m"),
    [((0.1, 0.3), 1.5, 0.8), ((0.1, 0.3), 0.4, 0.0), ((0.5, -0.1), 1.5, 0.0)],
)
def test_the_surface_below_a_body_is_a_top_or_the_ground_below_it(
    folder: Path, at_m: tuple[float, float], below_m: float, surface_m: float
) -> None:
    """A table that moves counts by its parts, as one that stands."""
    standing = alone(folder, "table", yaw_deg=90.0)
    assert standing.surface_m(*at_m, below_m) == pytest.approx(surface_m)
    path = "path_m: [[1.0, -1.0], [0.1, -1.0]], speed_mps: 0.4, yaw_deg: 90"
    moving = scene_of(folder, f"movers: [{{kind: table, {path}}}]\n{START}")
    pose = Pose(x_m=0.1, y_m=-0.1, z_m=0.4, yaw_rad=math.pi / 2)
    state = MoverState(name="mover-1", pose=pose, vx_mps=0.0, vy_mps=0.0)
    assert moving.surface_m(*at_m, below_m, [state]) == pytest.approx(surface_m)


def test_the_ground_below_a_table_is_free_but_hidden_from_above(folder: Path) -> None:
    plan = scene_of(folder, f"objects: [{{kind: table, position_m: [0, 0]}}]\n{START}").ground_plan
    cells = GroundCells(plan)
    assert int((~cells.free).sum()) == 4, "one cell below each leg"
    covered = CoveredGround(plan, anafi_camera(640, 360))
    above = Pose(x_m=0.0, y_m=0.0, z_m=1.6, yaw_rad=0.0)
    covered.add(0.0, values.truth(above, landing_error_m=None, gimbal_pitch_rad=-math.pi / 2))
    x_m, y_m = np.meshgrid(np.abs(cells.x_m), np.abs(cells.y_m))
    assert not covered.seen[(x_m < 0.4) & (y_m < 0.2)].any(), "below the top"
    assert covered.seen[(y_m > 0.75) & (y_m < 0.85) & (x_m < 0.4)].all(), "beyond its shadow"


@pytest.mark.parametrize(
    ("kind", "yaw_deg", "area_m2"), [("rack", 0.0, 1.2 * 0.4), ("drum", 20.0, math.pi * 0.3**2)]
)
def test_shelves_and_drums_cover_their_outline(
    folder: Path, kind: str, yaw_deg: float, area_m2: float
) -> None:
    cells = GroundCells(alone(folder, kind, yaw_deg=yaw_deg).ground_plan)
    assert float((~cells.free).sum()) * 0.05**2 == pytest.approx(area_m2, rel=0.1)


@pytest.mark.parametrize("step", [1, -1])
def test_an_object_beyond_the_inner_corner_of_a_polygon_stands_outside(
    tmp_path: Path, step: int
) -> None:
    """The corners may be stated either way round."""
    outline = str([[-3, -2], [3, -2], [3, 0], [0, 0], [0, 2], [-3, 2]][::step])
    folder = write_lab(tmp_path / "corner", LAB.replace("size_m: [6, 4]", f"outline_m: {outline}"))
    text = "objects: [{kind: table, position_m: [-0.6, 0.5]}]\n"
    body = body_in(scene_of(folder, text + START))
    for x_m, contacts in ((-0.2, ()), (0.0, ("wall-4",))):
        body.place(x_m, 1.2, 1.0, 0.0)
        assert body.contacts() == contacts
    for place in ("[-0.3, 0.2]", "[1, 1]"):  # over the corner, and beyond it
        with pytest.raises(SceneError, match="outside the ground"):
            scene_of(folder, text.replace("[-0.6, 0.5]", place) + START)


def test_the_ground_is_brighter_below_a_lamp(folder: Path) -> None:
    with Renderer(build_model(scene_of(folder, START))) as renderer:
        below, beyond = (
            renderer.rgb(lens(x_m, 0.0, 1.0, 0.0, -90.0), 160, 90).mean() for x_m in (-2.0, 2.0)
        )
    assert below > 1.3 * beyond


def test_classes_are_exact_with_more_surfaces_than_one_byte_counts(folder: Path) -> None:
    large = LAB.replace("size_m: [6, 4]", "size_m: [20, 20]")
    (folder / "lab.yaml").write_text(large, encoding="utf-8")
    text = "objects:\n" + "".join(
        f"  - {{kind: drum, position_m: [{-8 + 1.2 * k:.1f}, {-7 + 1.2 * row:.1f}]}}\n"
        for row in range(12)
        for k in range(12)
    )
    scene = scene_of(folder, f"{text}take_off: {{from: [-9.0, -9.0]}}\n")
    lab = build_model(scene)
    assert (lab.model.geom_group == 0).sum() > 256
    x_m, y_m = scene.placed[-1].spec.position_m
    with Renderer(lab) as renderer:
        ids = renderer.class_ids(lens(x_m - 1.0, y_m, 1.6, 0.0, -40.0), 160, 90)
    assert {4, 6} <= set(np.unique(ids).tolist()) <= {0, 1, 4, 6}
