"""Truth of the referee: contacts, clearance and positions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_bridge.plain.caster import Caster
from sim_bridge.twin.drone import TwinDrone
from sim_bridge.twin.referee import TwinReferee
from tests.sim_bridge.twin.lab_world import fly
from uav_bt.errors import ValueRangeError
from uav_bt.types import Command, Hover, Land, MoveBy, TakeOff, Velocity

MakeTwin = Callable[..., TwinDrone]

WALL = """
helipad: {position_m: [-1.5, -1.0]}
boxes:
  - {pattern: 1, position_m: [0.5, -1.0], size_m: [0.4, 1.0, 2.2]}
take_off: {from: helipad, yaw_deg: 0}
"""


@pytest.fixture
def wall_scene(tmp_path: Path) -> str:
    path = tmp_path / "wall.yaml"
    path.write_text(WALL, encoding="utf-8")
    return str(path)


def referee_of(drone: TwinDrone) -> TwinReferee:
    assert drone.referee is not None
    return drone.referee


def test_clearance_is_the_gap_between_hull_and_box(make_twin: MakeTwin, wall_scene: str) -> None:
    """On the pad 1.8 m before a wall, the front of the hull is 1.68 m from the wall."""
    drone = make_twin(scene=wall_scene)
    assert referee_of(drone).truth().clearance_m == pytest.approx(1.68, abs=1e-3)


def test_flying_into_a_box_is_a_contact_with_its_name(make_twin: MakeTwin, wall_scene: str) -> None:
    """The contact names the box, the clearance is 0, and the contact stays for one tick."""
    drone = make_twin(scene=wall_scene, airborne=True)
    assert referee_of(drone).truth().contacts == ()
    fly(drone, Velocity(forward_mps=0.5), 5.0)
    hit = referee_of(drone).truth()
    assert hit.contacts == ("box-1",)
    assert hit.clearance_m < 0.005
    fly(drone, MoveBy(id=1, forward_m=-1.0), 2.0)
    assert referee_of(drone).truth().contacts == ()


def test_a_touch_between_two_looks_is_not_missed(make_twin: MakeTwin, wall_scene: str) -> None:
    """A short contact within a tick is reported at the next tick."""
    drone = make_twin(scene=wall_scene, airborne=True)
    seen: set[str] = set()
    touched: set[str] = set()
    for step in range(600):
        drone.send(Command(movement=Velocity(forward_mps=0.8 if step < 320 else -0.8)))
        drone.clock.sleep_until(drone.clock.now() + 0.01)
        touched |= set(drone.simulation.body.contacts())
        if step % 10 == 0:
            seen |= set(referee_of(drone).truth().contacts)
    assert touched == seen == {"box-1"}


def test_standing_with_turning_motors_is_a_contact_with_the_surface(make_twin: MakeTwin) -> None:
    """The pad is a contact while the motors spin up, but not with motors off."""
    drone = make_twin()
    drone.clock.sleep_until(0.2)
    assert referee_of(drone).truth().contacts == ()
    fly(drone, TakeOff(), 0.5)
    assert referee_of(drone).truth().contacts == ("mark",)


def test_landing_beside_the_pad_is_measured(make_twin: MakeTwin, wall_scene: str) -> None:
    """At 1 m from the pad: not on the pad, error 1 m, inside the ground."""
    drone = make_twin(scene=wall_scene, airborne=True)
    fly(drone, MoveBy(id=1, forward_m=1.0), 3.0)
    fly(drone, Land(), 6.0)
    end = referee_of(drone).truth()
    assert not end.motors_on
    assert not end.on_mark
    assert end.inside_ground
    assert end.landing_error_m == pytest.approx(1.0, abs=0.05)
    assert end.pose.z_m == pytest.approx(0.05, abs=0.01)


def test_leaving_the_ground_is_seen(make_twin: MakeTwin, wall_scene: str) -> None:
    """The position of the body's centre counts."""
    drone = make_twin(scene=wall_scene, airborne=True)
    fly(drone, MoveBy(id=1, forward_m=-1.3), 4.0)
    assert not referee_of(drone).truth().inside_ground


def test_the_ground_of_a_larger_place_ends_later(make_twin: MakeTwin, tmp_path: Path) -> None:
    """A point 3.2 m from the middle is outside the paper's carpet, but inside one of 8 m."""
    path = tmp_path / "wide.yaml"
    path.write_text("ground: {size_m: [8, 4]}\nhelipad: {position_m: [3.2, 0]}\n", encoding="utf-8")
    referee = referee_of(make_twin(scene=str(path)))
    assert referee.truth().inside_ground
    assert referee.ground().size_m == (8.0, 4.0)


def test_boxes_of_one_pattern_are_distinguished(make_twin: MakeTwin, tmp_path: Path) -> None:
    """The second box of a pattern has a different name, and counts for the clearance."""
    path = tmp_path / "twice.yaml"
    second = "  - {pattern: 1, position_m: [2.0, 1.5], size_m: [0.4, 0.4, 1]}\n"
    path.write_text(WALL.replace("boxes:\n", "boxes:\n" + second), encoding="utf-8")
    drone = make_twin(scene=str(path), airborne=True)
    fly(drone, Velocity(forward_mps=0.5), 5.0)
    hit = referee_of(drone).truth()
    assert hit.contacts == ("box-1-2",)
    assert hit.clearance_m < 0.005


def test_without_boxes_the_clearance_is_infinite(make_twin: MakeTwin, tmp_path: Path) -> None:
    """Without obstacles the distance is infinite."""
    path = tmp_path / "bare.yaml"
    path.write_text("helipad: {position_m: [0, 0]}\n", encoding="utf-8")
    assert referee_of(make_twin(scene=str(path))).truth().clearance_m == math.inf


def test_masks_and_depth_show_the_frame_s_own_view(make_twin: MakeTwin) -> None:
    """Ids and depth of an old frame are those of its capture."""
    drone = make_twin(profile="lab", airborne=True)
    frame = drone.observe().frame
    assert frame is not None
    fly(drone, MoveBy(id=1, yaw_rad=2.0), 3.0)
    referee = referee_of(drone)
    ids, depth = referee.class_ids(frame, 320, 180), referee.depth(frame, 320, 180)
    capture = next(c for c in drone.simulation.frames if c.index == frame.index)
    want_ids, want_depth = Caster(drone.scene, (320, 180)).cast(capture.camera)
    assert (ids == want_ids).mean() > 0.98
    assert np.median(np.abs(depth - want_depth)[want_ids != 0]) < 1e-3


def test_a_forgotten_or_foreign_frame_is_refused(make_twin: MakeTwin) -> None:
    """After 30 s, or for another flight, the error lists the available frames."""
    drone = make_twin()
    drone.clock.sleep_until(0.2)
    frame = drone.observe().frame
    assert frame is not None
    with pytest.raises(ValueRangeError, match="not of this flight"):
        referee_of(drone).class_ids(replace(frame, captured_s=0.123), 64, 36)
    fly(drone, Hover(), 31.0)
    with pytest.raises(ValueRangeError, match="30 s"):
        referee_of(drone).depth(frame, 64, 36)
