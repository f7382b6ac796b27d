"""The body without MuJoCo: the twin's motion in free flight, and solids that stop it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.fit_airframe import BOXES, MANOEUVRES, OPEN, flown, random_commands
from sim_bridge.plain.airframe import PlainBody
from sim_bridge.plain.solids import solids_of
from sim_bridge.twin.body import CONTROL_STEP_S, Body, Motion
from sim_bridge.twin.flying_body import FlyingBody
from sim_bridge.twin.model import build_model
from sim_bridge.twin.movers import MoverSpec
from sim_bridge.twin.objects import Helipad
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.routes import Traffic
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene
from tests.sim_bridge.twin.room_world import LAB, alone, scene_of, write_lab

OUTLINE = "outline_m: [[-3, -2], [3, -2], [3, 0], [0, 0], [0, 2], [-3, 2]]"
LAG_S = 0.12
STANDING_M = 0.05
PAD = Scene(name="pad", helipad=Helipad(position_m=(0.0, 0.0)), boxes=BOXES.boxes)


def bodies(scene: Scene) -> tuple[Body, Body]:
    twin = FlyingBody(build_model(scene, drawn=False), lag_s=LAG_S)
    return twin, PlainBody(scene, lag_s=LAG_S)


def advance(body: Body, seconds: float, push_mps2: tuple[float, float, float] | None) -> Motion:
    """Advance with a demanded acceleration; None: motors off."""
    for _ in range(round(seconds / CONTROL_STEP_S)):
        motion = body.motion()
        if push_mps2 is None:
            body.drop()
        else:
            body.fly(motion, push_mps2, 0.0, (0.0, 0.0, 0.0))
        body.advance()
    return body.motion()


def apart_m(one: Motion, other: Motion) -> float:
    return math.dist((one.x_m, one.y_m, one.z_m), (other.x_m, other.y_m, other.z_m))


@pytest.mark.parametrize("name", ["lab", "harsh"])
def test_it_flies_as_the_twin_s_body(name: str) -> None:
    """20 s of random commands with the same seed and wind: position, tilt and heading."""
    profile, manoeuvre = Profile.named(name), random_commands(4)
    twin, plain = (flown(manoeuvre, body, profile, 4) for body in bodies(OPEN))
    pairs = list(zip(twin, plain, strict=True))
    assert max(abs(one.x_m - twin[0].x_m) for one in twin) > 0.5
    assert np.mean([apart_m(*pair) for pair in pairs]) < 0.002
    for angle in ("roll_rad", "pitch_rad", "yaw_rad"):
        off = [getattr(one, angle) - getattr(other, angle) for one, other in pairs]
        assert max(map(abs, off)) < math.radians(0.5)


@pytest.mark.parametrize("name", ["take-off", "landing", "motors cut"])
def test_it_leaves_and_reaches_the_ground_as_the_twin_s_body(name: str) -> None:
    manoeuvre, profile = MANOEUVRES[name], Profile.named("lab")
    twin, plain = (flown(manoeuvre, body, profile, 1) for body in bodies(OPEN))
    assert max(map(apart_m, twin, plain)) < 0.05
    assert apart_m(twin[-1], plain[-1]) < 0.01


def test_its_solids_have_the_names_of_the_twin_s() -> None:
    mover = MoverSpec(path_m=((-2.0, 1.5), (2.0, 1.5)), speed_mps=0.5)
    for scene in (replace(PAD, movers=(mover,)), OPEN):
        model = build_model(scene, drawn=False).model
        geoms = {model.geom(index).name for index in range(model.ngeom)} - {"drone"}
        assert sorted(geoms) == sorted(solids_of(scene).names)


@pytest.mark.parametrize(
    ("push_mps2", "contact"),
    [((1.0, 0.0, 0.0), "wall-east"), ((0.0, -1.0, 0.0), "wall-south"), ((0, 0, 1), "ceiling")],
)
def test_walls_and_ceiling_stop_it(push_mps2: tuple[float, float, float], contact: str) -> None:
    for body in bodies(OPEN):
        body.place(0.0, 0.0, 1.0, 0.0)
        end = advance(body, 6.0, push_mps2)
        assert body.contacts() == (contact,)
        assert math.hypot(end.vx_mps, end.vy_mps, end.vz_mps) < 0.01
        assert max(abs(end.x_m), abs(end.y_m)) < 8.5
        assert end.z_m < 5.0


def test_a_box_stops_it_and_the_contact_ends_with_the_retreat() -> None:
    for body in bodies(BOXES):
        body.place(0.0, 0.0, 1.0, math.radians(20.0))
        end = advance(body, 3.0, (1.0, 0.0, 0.0))
        assert body.contacts() == ("box-1",)
        assert body.clearance_m() < 0.005
        assert end.x_m < 0.75
        advance(body, 1.0, (-1.0, 0.0, 0.0))
        assert body.contacts() == ()
        assert body.clearance_m() > 0.05


def test_with_motors_off_it_falls_and_rests_on_what_is_below() -> None:
    for scene, place, contact, rests_m in (
        (PAD, (0.1, 0.1), "mark", 0.4),
        (PAD, (-0.95, 0.0), "box-2", 0.5),
        (PAD, (0.0, -1.0), "ground", 0.0),
        (PAD, (0.0, -2.5), "floor", -0.004),
    ):
        for body in bodies(scene):
            body.place(*place, 1.0, 0.3)
            advance(body, 0.1, (1.0, 0.0, 0.0))
            end = advance(body, 2.0, None)
            assert body.contacts() == (contact,)
            assert end.z_m == pytest.approx(rests_m + STANDING_M, abs=2e-3)
            assert math.hypot(end.vx_mps, end.vy_mps, end.vz_mps) < 1e-3
            assert max(abs(end.roll_rad), abs(end.pitch_rad)) < 1e-2


def test_it_does_not_rest_on_an_edge() -> None:
    """With its centre beside the box it ends on the ground; across the ground's edge it stays."""
    for body in bodies(BOXES):
        body.place(-0.68, 0.0, 0.56, 0.0)
        advance(body, 3.0, None)
        assert "ground" in body.contacts()
    _, body = bodies(OPEN)
    body.place(6.05, 0.0, STANDING_M, 0.0)
    assert advance(body, 1.0, None).x_m == pytest.approx(6.05, abs=1e-3)


@pytest.mark.parametrize("shape", ["box", "cylinder"])
def test_a_mover_pushes_a_standing_drone_away(shape: str) -> None:
    mover = MoverSpec(path_m=((-1.0, 0.0), (3.0, 0.0)), speed_mps=1.0, shape=shape)
    scene = replace(OPEN, movers=(mover,), take_off=replace(OPEN.take_off, position_m=(0.0, 3.0)))
    body, traffic = PlainBody(scene, lag_s=LAG_S), Traffic(scene.movers, 0)
    body.place(0.0, 0.0, STANDING_M, 0.0)
    touched: set[str] = set()
    for step in range(200):
        body.place_movers(traffic.at(CONTROL_STEP_S * step))
        advance(body, CONTROL_STEP_S, None)
        touched |= set(body.contacts())
        assert body.clearance_m() > 0.0 or "mover-1" in body.contacts()
    assert touched == {"ground", "mover-1"}
    front_m = traffic.at(2.0)[0].pose.x_m + 0.2
    assert body.motion().x_m - front_m == pytest.approx(0.12, abs=0.02)


def test_a_fast_fall_does_not_pass_through_the_ground() -> None:
    _, body = bodies(OPEN)
    body.place(0.0, 0.0, 4.9, 0.0)
    lowest = min(advance(body, CONTROL_STEP_S, None).z_m for _ in range(150))
    assert lowest == pytest.approx(STANDING_M, abs=1e-3)


@pytest.mark.parametrize(
    ("kind", "level_m"),
    [("drum", 0.6), ("crate", 0.3), ("table", 0.78), ("rack", 1.96), ("cone", 0.3)],
)
def test_every_shape_of_a_lab_stops_it(tmp_path: Path, kind: str, level_m: float) -> None:
    """From above, beside and below: the first contact is where the twin's body has it."""
    scene = alone(write_lab(tmp_path / "hall"), kind)
    ways = [
        ((0.1, -0.1, scene.placed[0].shape.kind.size_m[2] + 0.15), None),
        ((-1.2, -0.1, level_m), (0.5, 0.0, 0.0)),
        ((0.1, 1.2, level_m), (0.0, -0.5, 0.0)),
        ((0.1, -0.1, 0.2), (0.0, 0.0, 0.5)),
    ]
    for place, push in ways[: 4 if kind == "table" else 3]:
        ends = []
        for body in bodies(scene):
            body.place(*place, 0.4)
            while not body.contacts():
                end = advance(body, CONTROL_STEP_S, push)
            ends.append(end)
            assert body.contacts() == (f"{kind}-1",)
            assert body.clearance_m() < 0.02
        assert apart_m(*ends) < 0.025
        if push is not None and kind != "cone":  # it slides over a cone
            after = advance(body, 1.0, push)
            way_m = after.x_m - end.x_m, after.y_m - end.y_m, after.z_m - end.z_m
            assert np.dot(way_m, push) < 0.05


def test_the_room_of_a_lab_stops_it() -> None:
    """Ground, ceiling and a wall of the depot, by the names of the twin's contacts."""
    scene = load_scene("depot-train-b")
    rows = solids_of(scene)
    model = build_model(scene, drawn=False)
    names = {model.contact_name(geom) for geom in range(model.model.ngeom)} - {"drone"}
    assert set(rows.names) == names
    assert len(rows.names) == model.model.ngeom - 1
    for place, push, contact in (
        ((0.0, 0.3, 0.6), None, "ground"),
        ((0.0, 0.3, 4.0), (0.0, 0.0, 1.0), "ceiling"),
        ((0.0, 0.3, 3.0), (2.0, 0.0, 0.0), "wall-4"),
    ):
        for body in bodies(scene):
            body.place(*place, 0.0)
            advance(body, 3.0, push)
            assert body.contacts() == (contact,)


def test_a_ground_with_an_outline_carries_it(tmp_path: Path) -> None:
    folder = write_lab(tmp_path / "hall", LAB.replace("size_m: [6, 4]", OUTLINE))
    scene = scene_of(folder, "take_off: {from: [-2.0, -1.0]}\n")
    for body in bodies(scene):
        for place_m, below in (((-1.0, 1.0), "ground"), ((2.0, -1.0), "ground")):
            body.place(*place_m, 0.5, 0.3)
            assert advance(body, 1.5, None).z_m == pytest.approx(STANDING_M, abs=2e-3)
            assert body.contacts() == (below,)


def test_a_moving_mesh_pushes_it_and_its_pieces_move_together(tmp_path: Path) -> None:
    text = """\
take_off: {from: [-2.5, -1.5]}
movers:
  - {kind: cone, path_m: [[-1.5, 0.0], [2.0, 0.0]], speed_mps: 0.5, yaw_deg: 30}
  - {kind: table, path_m: [[2.0, 1.0], [0.0, 1.2]], speed_mps: 0.4, yaw_deg: 10}
"""
    scene = scene_of(write_lab(tmp_path / "hall"), text)
    twin, plain = bodies(scene)
    traffic, draw = Traffic(scene.movers, 0), np.random.default_rng(2)
    for time_s in (0.0, 1.5, 3.0):
        for body in (twin, plain):
            body.place_movers(traffic.at(time_s))
        for _ in range(20):
            place = draw.uniform((-2.0, -1.0, 0.2, -3.0), (2.5, 1.8, 1.2, 3.0))
            for body in (twin, plain):
                body.place(*place)
            assert plain.clearance_m() == pytest.approx(twin.clearance_m(), abs=2e-4)
    plain.place(0.0, 0.0, STANDING_M, 0.0)
    touched: set[str] = set()
    for step in range(400):
        plain.place_movers(traffic.at(CONTROL_STEP_S * step))
        advance(plain, CONTROL_STEP_S, None)
        touched |= set(plain.contacts())
    assert touched == {"ground", "mover-1"}
    assert plain.motion().x_m > 0.2


def test_without_boxes_the_clearance_is_infinite() -> None:
    for body in bodies(OPEN):
        body.place(0.0, 0.0, 1.0, 0.0)
        assert body.clearance_m() == math.inf
