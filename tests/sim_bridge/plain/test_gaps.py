"""Distances of the hull from boxes, cylinders and meshes, against MuJoCo's."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_bridge.plain.gaps import GAP_COLUMNS, clearance, find_near
from sim_bridge.plain.solids import solids_of
from sim_bridge.twin.body import HULL_HALF_M
from sim_bridge.twin.gl import load_mujoco
from sim_bridge.twin.scene_file import load_scene

load_mujoco()  # MuJoCo selects its OpenGL backend when imported

import mujoco  # noqa: E402  (after load_mujoco)

from sim_bridge.twin.flying_body import FlyingBody  # noqa: E402  (after load_mujoco)
from sim_bridge.twin.model import build_model  # noqa: E402  (after load_mujoco)

HALF_M = np.array(HULL_HALF_M)
CUBE = np.array([[1.0, 0.0, 0.2, 0.2, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]])
NO_HULLS = np.empty((0, 4, 3))


def by_mujoco(pose: np.ndarray, row: np.ndarray) -> float:
    """Return the distance of the hull from one solid."""
    x, y, half_x, half_y, low, top, cos, sin, is_round, *_ = row
    spec, kinds, half_z = mujoco.MjSpec(), mujoco.mjtGeom, (top - low) / 2
    spec.worldbody.add_geom(
        name="solid",
        type=kinds.mjGEOM_CYLINDER if is_round else kinds.mjGEOM_BOX,
        size=(half_x, half_z, 0.0) if is_round else (half_x, half_y, half_z),
        pos=(x, y, low + half_z),
        quat=_about((0, 0, 1), math.atan2(sin, cos)),
    )
    body = spec.worldbody.add_body(name="hull", pos=pose[:3], quat=_turned(pose))
    body.add_geom(name="hull", type=kinds.mjGEOM_BOX, size=HALF_M)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return max(0.0, mujoco.mj_geomDistance(model, data, 1, 0, 30.0, None))


def _turned(pose: np.ndarray) -> np.ndarray:
    turn, both = np.zeros(4), np.zeros(4)
    mujoco.mju_mulQuat(turn, _about((0, 0, 1), pose[5]), _about((0, 1, 0), -pose[4]))
    mujoco.mju_mulQuat(both, turn, _about((1, 0, 0), pose[3]))
    return both


def _about(axis: tuple[int, int, int], angle_rad: float) -> np.ndarray:
    return np.array([math.cos(angle_rad / 2), *(math.sin(angle_rad / 2) * np.array(axis))])


@pytest.mark.parametrize("is_round", [False, True])
def test_distances_are_those_of_mujoco(*, is_round: bool) -> None:
    """Random poses around random solids: beside, above, level, tilted and overlapping."""
    draw, overlaps = np.random.default_rng(3), 0
    for number in range(150):
        half_x, half_y, top, yaw = draw.uniform((0.1, 0.1, 0.2, -3.1), (0.6, 0.6, 2.2, 3.1))
        sizes = half_x, half_x if is_round else half_y, 0.0, top
        row = np.array([0.3, -0.2, *sizes, math.cos(yaw), math.sin(yaw), float(is_round), 0.0, 0.0])
        pose = draw.uniform((-1.2, -1.5, 0.1, -0.3, -0.3, -3), (1.5, 1.0, 2.4, 0.3, 0.3, 3))
        if number % 5 == 0:
            pose[3:] = 0.0, 0.0, yaw  # parallel faces
        expected = by_mujoco(pose, row)
        overlaps += expected == 0.0
        assert clearance(pose, HALF_M, (row[None], NO_HULLS)) == pytest.approx(expected, abs=2e-4)
    assert 5 < overlaps < 75


def test_the_nearest_of_several_solids_counts() -> None:
    row = CUBE[0].copy()
    row[0] = -0.6
    pose = np.array([0.0, 0.0, 0.5, 0.0, 0.0, 0.0])
    both = np.vstack([CUBE, row]), NO_HULLS
    assert clearance(pose, HALF_M, both) == pytest.approx(0.28, abs=1e-4)
    assert clearance(pose, HALF_M, (np.empty((0, GAP_COLUMNS)), NO_HULLS)) == math.inf


@pytest.mark.parametrize(
    ("place", "gap_m", "normal"),
    [
        ((0.6, 0.0, 0.5), 0.08, (-1.0, 0.0, 0.0)),
        ((1.0, -0.4, 0.5), 0.04, (0.0, -1.0, 0.0)),
        ((1.0, 0.0, 1.06), 0.01, (0.0, 0.0, 1.0)),
        ((0.75, 0.0, 0.5), 0.0, (-1.0, 0.0, 0.0)),
        ((1.0, 0.1, 0.98), 0.0, (0.0, 0.0, 1.0)),
        ((1.0, 0.17, 0.5), 0.0, (0.0, 1.0, 0.0)),
    ],
)
def test_a_solid_nearby_has_a_gap_and_a_normal(
    place: tuple[float, float, float], gap_m: float, normal: tuple[float, float, float]
) -> None:
    """Beside and above a cube; in it the normal is that of the nearest face."""
    found = np.zeros((2, 5))
    far = CUBE[0].copy()
    far[1] = 5.0
    pose = np.array([*place, 0.0, 0.0, 0.0])
    assert find_near(pose, HALF_M, (np.vstack([far, CUBE]), NO_HULLS), 0.1, found) == 1
    assert found[0] == pytest.approx([1.0, gap_m, *normal], abs=1e-4)


def test_clearances_in_a_depot_are_those_of_mujoco() -> None:
    """Random poses among drums, crates, racks, tables and barriers; some overlap a solid."""
    scene = load_scene("depot-train-b")
    twin = FlyingBody(build_model(scene, drawn=False), lag_s=0.1)
    solids, draw, overlaps = solids_of(scene), np.random.default_rng(5), 0
    rows = solids.table[: solids.obstacles], solids.facets
    barrier_m = next(each.spec.position_m for each in scene.placed if each.shape.mesh is not None)
    for number in range(400):
        pose = draw.uniform((-3.6, -2.6, 0.1, -0.3, -0.3, -3.1), (3.6, 2.6, 2.2, 0.3, 0.3, 3.1))
        if number % 4 == 0:
            pose[:3] = np.array((*barrier_m, 0.4)) + draw.uniform(-0.7, 0.7, 3)
        twin.place(*pose[:3], 0.0)
        twin.data.qpos[3:7] = _turned(pose)
        expected = twin.clearance_m()
        overlaps += expected == 0.0
        assert clearance(pose, HALF_M, rows) == pytest.approx(expected, abs=2e-4)
    assert 10 < overlaps < 200
