"""The drone without images: its flights repeat, its perception has the errors that it states."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sim_bridge.plain import PlainConfig
from sim_bridge.plain.drone import PlainDrone
from sim_bridge.plain.sight import SightErrors
from uav_bt import app
from uav_bt.app.replay import replay
from uav_bt.classes import CARPET
from uav_bt.errors import DroneError, FileError, InputError
from uav_bt.protocols import Drone, Imageless, Sight
from uav_bt.types import Command, GimbalTo, MoveBy, Observation, TakeOff


def connected(**options: object) -> PlainDrone:
    drone = PlainConfig(**options).create()
    drone.connect()
    return drone


def flown(drone: PlainDrone, ticks: int) -> list[Observation]:
    """Take off, look down, and fly a turn."""
    seen = []
    for tick in range(ticks):
        seen.append(drone.observe())
        movement = TakeOff() if tick < 45 else MoveBy(id=1, forward_m=1.0, yaw_rad=0.8)
        drone.send(Command(movement=movement, gimbal=GimbalTo(pitch_rad=-0.6)))
        drone.clock.sleep_until(0.1 * (tick + 1))
    return seen


def test_it_keeps_the_protocols() -> None:
    drone = connected()
    assert isinstance(drone, Drone)
    assert isinstance(drone, Imageless)
    assert isinstance(drone.sight, Sight)
    drone.disconnect()
    drone.disconnect()
    with pytest.raises(DroneError, match="connect"):
        drone.observe()


def test_a_flight_repeats_and_another_seed_is_another_flight() -> None:
    def report(seed: int) -> dict[str, object]:
        flown = app.fly("land_only", drone="plain", scene="val-a", seed=seed).to_json()
        return {name: value for name, value in flown.items() if not name.endswith("_ms")}

    first = report(3)
    assert first["outcome"] == "success"
    assert report(3) == first
    assert report(4) != first


def test_class_maps_differ_from_the_exact_ones_on_borders_only() -> None:
    drone = connected(scene="val-a", seed=1)
    frame = flown(drone, 60)[-1].frame
    assert frame is not None
    assert drone.sight is not None
    assert drone.referee is not None
    ids = drone.sight.segment(frame).ids
    exact = drone.referee.class_ids(frame, *ids.shape[::-1])
    share = np.mean(ids != exact)
    assert 0.001 < share < 0.05
    assert np.mean(ids == CARPET) == pytest.approx(np.mean(exact == CARPET), abs=0.02)


def test_the_measured_motion_has_the_stated_error() -> None:
    """From frame to frame, beside the true motion of the lens; none before ground is in view."""
    errors, drone = SightErrors(), connected(scene="val-a", seed=2, profile="ideal")
    frames = [seen.frame for seen in flown(drone, 90) if seen.frame is not None]
    assert drone.sight is not None
    off = []
    for before, after in itertools.pairwise(frames):
        drone.sight.segment(after)
        found = drone.sight.motion(before, after)
        if found is None:
            continue
        first, second = (drone.simulation.frames[frame.index].camera for frame in (before, after))
        forward_m, left_m = first.to_body(second.x_m, second.y_m)
        off.append((found.x_m - forward_m, found.y_m + left_m))
    assert len(off) > 30
    assert np.std(off) == pytest.approx(errors.shift_m, rel=0.3)
    assert drone.sight.motion(frames[0], frames[1]) is None


def test_a_mission_that_looks_at_images_is_refused() -> None:
    with pytest.raises(InputError, match="this drone has none; fly the mission with --drone twin"):
        app.fly("explore_and_land_student", drone="plain")


def test_its_record_cannot_be_replayed(tmp_path: Path) -> None:
    record = tmp_path / "flight.mcap"
    app.fly("land_only", drone="plain", scene="val-a", seed=3, record=record)
    with pytest.raises(FileError, match=r"flight\.mcap: was flown without images"):
        replay(record)


def test_it_needs_no_opengl() -> None:
    code = (
        "from uav_bt import app; "
        "print(app.fly('land_only', drone='plain', scene='val-a', seed=3).outcome)"
    )
    done = subprocess.run(  # noqa: S603  (code of this test)
        [sys.executable, "-c", code],
        env={**os.environ, "MUJOCO_GL": "disable"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "success\n"
