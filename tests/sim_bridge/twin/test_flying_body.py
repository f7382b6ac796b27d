"""The drone's body in MuJoCo: what it touches, what stops it, and how far it is from obstacles."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from sim_bridge.twin.body import CONTROL_STEP_S, Motion
from sim_bridge.twin.flying_body import FlyingBody, Vector
from sim_bridge.twin.movers import MoverSpec, Traffic
from sim_bridge.twin.objects import Helipad, ObjectSpec
from sim_bridge.twin.scene import Scene, TakeOffSpec
from sim_bridge.twin.scene_file import load_scene
from tests.sim_bridge.twin.room_world import L_SHAPED, START, alone, body_in, scene_of, write_lab

STANDING_M = 0.05
OPEN = Scene(name="open", ground_size_m=(12.0, 12.0), take_off=TakeOffSpec(position_m=(0.0, 3.0)))
PAD = Scene(
    name="pad",
    ground_size_m=(4.0, 4.0),
    objects=(ObjectSpec(kind="box-2", position_m=(-1.0, 0.0), size_m=(0.5, 0.5, 0.5)),),
    helipad=Helipad(position_m=(0.0, 0.0)),
)


def advance(body: FlyingBody, seconds: float, push_mps2: Vector | None) -> Motion:
    """Advance with a demanded acceleration; None: motors off."""
    for _ in range(round(seconds / CONTROL_STEP_S)):
        if push_mps2 is None:
            body.drop()
        else:
            body.fly(body.motion(), push_mps2, 0.0, (0.0, 0.0, 0.0))
        body.advance()
    return body.motion()


@pytest.mark.parametrize(
    ("scene", "push_mps2", "contact"),
    [
        (OPEN, (1.0, 0.0, 0.0), "wall-east"),
        (OPEN, (0.0, -1.0, 0.0), "wall-south"),
        (OPEN, (0.0, 0.0, 1.0), "ceiling"),
        (load_scene("depot-train-b"), (0.0, 0.0, 1.0), "ceiling"),
    ],
)
def test_the_room_stops_it(scene: Scene, push_mps2: Vector, contact: str) -> None:
    body = body_in(scene)
    body.place(0.0, 0.3, 1.0, 0.0)
    assert scene is not OPEN or body.clearance_m() == math.inf, "the room is no obstacle"
    end = advance(body, 6.0, push_mps2)
    assert body.contacts() == (contact,)
    assert math.hypot(end.vx_mps, end.vy_mps, end.vz_mps) < 0.01


@pytest.mark.parametrize(
    ("place", "contact", "rests_m"),
    [
        ((0.1, 0.1), "mark", 0.4),
        ((-0.95, 0.0), "box-2", 0.5),
        ((0.0, -1.0), "ground", 0.0),
        ((0.0, -2.5), "floor", -0.004),
    ],
)
def test_with_motors_off_it_falls_and_rests_on_what_is_below(
    place: tuple[float, float], contact: str, rests_m: float
) -> None:
    body = body_in(PAD)
    body.place(*place, 1.0, 0.3)
    advance(body, 0.1, (1.0, 0.0, 0.0))
    end = advance(body, 2.0, None)
    assert body.contacts() == (contact,)
    assert end.z_m == pytest.approx(rests_m + STANDING_M, abs=2e-3)
    assert max(abs(end.roll_rad), abs(end.pitch_rad)) < 1e-2


@pytest.mark.parametrize("shape", ["box", "cylinder"])
def test_a_mover_pushes_a_standing_drone_away(shape: str) -> None:
    mover = MoverSpec(path_m=((-1.0, 0.0), (3.0, 0.0)), speed_mps=1.0, shape=shape)
    scene = replace(OPEN, movers=(mover,))
    body, traffic = body_in(scene), Traffic(scene.movers, 0)
    body.place(0.0, 0.0, STANDING_M, 0.0)
    touched: set[str] = set()
    for step in range(200):
        body.place_movers(traffic.at(CONTROL_STEP_S * step))
        advance(body, CONTROL_STEP_S, None)
        touched |= set(body.contacts())
    assert touched == {"ground", "mover-1"}
    assert body.motion().x_m > 0.5


@pytest.mark.parametrize(
    ("kind", "at_m", "touches"),
    [
        ("drum", (0.1, -0.1, 0.9), True),
        ("drum", (0.47, 0.27, 0.5), False),  # beside its round side
        ("crate", (0.35, -0.2, 0.3), True),
        ("rack", (0.1, -0.1, 1.96), True),
        ("table", (0.1, -0.1, 1.0), False),  # above the top at 0.8 m
        ("table", (0.1, -0.1, 0.8), True),  # in the top
        ("table", (0.1, -0.1, 0.4), False),  # below it, between the legs
        ("table", (0.53, 0.13, 0.4), True),  # in a leg, 0.05 m within the edge
        ("cone", (-0.05, -0.1, 0.3), True),
        ("cone", (0.3, -0.3, 0.1), True),  # the small piece beside it
        ("cone", (0.2, 0.15, 0.6), False),  # above that piece
    ],
)
def test_every_shape_of_a_lab_is_touched_at_its_parts_by_its_name(
    hall: Path, kind: str, at_m: Vector, *, touches: bool
) -> None:
    body = body_in(alone(hall, kind, yaw_deg=0.0))
    body.place(*at_m, 0.0)
    assert body.contacts() == ((f"{kind}-1",) if touches else ())
    assert (body.clearance_m() == 0.0) == touches


def test_a_ground_with_an_outline_carries_it(tmp_path: Path) -> None:
    body = body_in(scene_of(write_lab(tmp_path / "hall", L_SHAPED), START))
    for place_m in ((-1.0, 1.0), (2.0, -1.0)):
        body.place(*place_m, 0.5, 0.3)
        assert advance(body, 1.5, None).z_m == pytest.approx(STANDING_M, abs=2e-3)
        assert body.contacts() == ("ground",)
