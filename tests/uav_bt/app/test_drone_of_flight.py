"""Drones around others: a camera file, a rehearsal, and faults as texts or drawn from the seed."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_bridge.olympe import AnafiConfig
from sim_bridge.plain import PlainConfig
from sim_bridge.twin import TwinConfig
from sim_bridge.twin.scene_file import shipped_scenes
from tests.worlds.footage import camera_file
from tests.worlds.trees import document
from uav_bt import app
from uav_bt.app.drone_of_flight import (
    CalibratedDrone,
    RehearsedDrone,
    check_phases,
    drawn,
    with_faults,
)
from uav_bt.errors import FileError, InputError, UnknownNameError, ValueRangeError
from uav_bt.protocols import Drone
from uav_bt.testing import Fault, FaultyDrone, ScriptedDrone, pinhole
from uav_bt.tree import Leaf, NodeRegistry
from uav_bt.types import (
    Command,
    CutMotors,
    DroneState,
    FlyingState,
    GimbalTo,
    Hover,
    Land,
    MoveBy,
    Movement,
    MovementState,
    Release,
    TakeOff,
    Velocity,
)

# --- a camera file --------------------------------------------------------------------------------

TWIN = TwinConfig(profile="ideal", image_size_px=(160, 90))
LENS = replace(pinhole(1280, 720), fx_px=900.0, distortion=(-0.1, 0.0, 0.0, 0.0, 0.0))


def test_a_camera_file_is_scaled_to_the_frames_and_straightens_each_once(tmp_path: Path) -> None:
    """It has no distortion, since the frames are rectified; the lens position is the drone's."""
    bent = TWIN.create()
    file = camera_file(tmp_path / "camera.yaml", LENS)
    straight = app.make_drone(
        app.FlightOptions(camera=file, image_size_px=(160, 90), profile="ideal")
    )
    assert isinstance(straight, CalibratedDrone)
    bent.connect()
    straight.connect()
    try:
        camera = straight.camera
        assert (camera.width_px, camera.height_px) == (160, 90)
        assert camera.fx_px == pytest.approx(900.0 / 8)
        assert camera.distortion == ()
        assert camera.forward_offset_m == bent.camera.forward_offset_m
        raw, first, again = bent.observe(), straight.observe(), straight.observe()
        assert raw.frame is not None
        assert first.frame is not None
        assert again.frame is first.frame
        assert first.frame.index == raw.frame.index
        assert first.frame.image.shape == raw.frame.image.shape
        assert not np.array_equal(first.frame.image, raw.frame.image)
        assert first.state == raw.state
        assert straight.referee is not None
        assert straight.referee.class_ids(first.frame, 32, 18).shape == (18, 32)
    finally:
        bent.disconnect()
        straight.disconnect()


def test_a_camera_of_another_aspect_flies_nothing(tmp_path: Path) -> None:
    square = camera_file(tmp_path / "camera.yaml", replace(LENS, height_px=960))
    drone = CalibratedDrone(TWIN.create(), square)
    with pytest.raises(ValueRangeError, match="1280x960"):
        drone.connect()
    with pytest.raises(FileError, match="no such camera file"):
        CalibratedDrone(TWIN.create(), tmp_path / "absent.yaml").connect()


# --- rehearsals -----------------------------------------------------------------------------------


class Stage:
    """A rehearsal with a drone in a person's hands, which has taken off in numbers."""

    def __init__(self) -> None:
        self.held = ScriptedDrone()
        self.held.live = True
        self.drone: Drone = RehearsedDrone(self.held)
        self.drone.connect()
        assert self.play(TakeOff(), 3.5).flying is FlyingState.HOVERING

    def play(self, movement: Movement, seconds: float) -> DroneState:
        """Send a movement for some time and return the last state."""
        for _ in range(round(10 * seconds)):
            self.drone.observe()
            self.drone.send(Command(movement=movement))
            self.held.clock.advance(0.1)
        return self.drone.observe().state


def test_the_drone_gets_only_camera_directions() -> None:
    stage = Stage()
    assert stage.drone.live
    assert stage.held.commands == []
    for movement in (MoveBy(id=1, forward_m=1.0), Velocity(forward_mps=1.0), Land(), CutMotors()):
        command = Command(movement=movement, gimbal=GimbalTo(pitch_rad=-0.5))
        assert stage.drone.send(command) == command
    pointed = Command(movement=Release(), gimbal=GimbalTo(pitch_rad=-0.5))
    assert stage.held.commands == [pointed] * 4


def test_a_pretended_flight_has_heights_and_ends() -> None:
    stage = Stage()
    assert stage.play(Hover(), 0.2).altitude_m == pytest.approx(1.0)
    up = stage.play(MoveBy(id=1, down_m=-0.5), 2.0)
    assert up.movement is not None
    assert (up.movement.id, up.movement.state) == (1, MovementState.DONE)
    assert up.altitude_m == pytest.approx(1.5)
    sinking = stage.play(Velocity(down_mps=0.5), 1.0)
    assert sinking.flying is FlyingState.FLYING
    assert sinking.altitude_m == pytest.approx(1.0, abs=0.06)
    for movement, seconds, answer in (
        (MoveBy(id=5, yaw_rad=math.pi), 1.0, MovementState.RUNNING),
        (Hover(), 0.2, MovementState.INTERRUPTED),
    ):
        status = stage.play(movement, seconds).movement
        assert status is not None
        assert status.state is answer
    down = stage.play(Land(), 3.5)
    assert (down.flying, down.altitude_m) == (FlyingState.LANDED, 0.0)
    for movement in (Hover(), MoveBy(id=9, forward_m=1.0), Velocity(forward_mps=1.0), Land()):
        assert stage.play(movement, 0.3).flying is FlyingState.LANDED


def test_a_site_without_limits_leaves_those_of_the_options_to_the_drone() -> None:
    config, limits = AnafiConfig(), app.Limits(speed_mps=2.0)
    drone: Any = app.make_drone(app.FlightOptions(drone=config, site=app.Site(), limits=limits))
    assert drone._config.speed_limit_mps == 2.0


# --- faults ---------------------------------------------------------------------------------------


def options(seed: int, scene: str | None = "val-a") -> app.FlightOptions:
    return drawn(app.FlightOptions(drone="plain", seed=seed, scene=scene, faults=["random"]))


def test_seed_and_scene_draw_the_flight(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They do not depend on how the scene's file is named, and leave the drone a chance."""
    many = [options(seed) for seed in range(200)]
    assert options(1) == many[1] != options(1, "val-b")
    assert all(one.vary_room for one in many)
    assert {one.movers for one in many} == {0, 1}
    assert {len(one.faults) for one in many} == {0, 1, 2, 3}
    assert len({one.faults for one in many[:40]}) > 20
    kinds = {Fault.parse(text).kind.name for one in many for text in one.faults}
    assert len(kinds) > 25
    hopeless = {"deaf", "no-landing", "motors-cut", "link-lost", "pilot"}
    assert not kinds & (hopeless | {"no-take-off", "send-raises"})
    monkeypatch.chdir(tmp_path)
    Path("mine.yaml").write_bytes(shipped_scenes()["val-a"].read_bytes())
    paths = ["mine.yaml", "./mine.yaml", str(tmp_path / "mine.yaml")]
    assert len({options(4, path).faults for path in paths}) == 1
    assert options(4, None).faults == options(4, "train-a").faults


def test_the_draws_of_shipped_scenes_stay() -> None:
    """Campaigns of before can be flown again."""
    assert options(0, "train-a").faults == ("velocity-bias=-0.11@explore+20.4~10.6",)
    assert options(0, "val-b").faults == (
        *("drift=0.15@explore+6.7~9.2", "attitude-nan@center+0.5~8.1"),
        "battery-drains=0.071@explore+2.2~14.1",
    )


def test_a_file_holds_a_fault_per_line_and_a_mistake_has_its_line(tmp_path: Path) -> None:
    file = tmp_path / "faults.txt"
    file.write_text("wind=0.1@explore\n\nblack@start\n")
    assert app.FlightOptions(faults=[f"@{file}"]).faults == ("wind=0.1@explore", "black@start")
    file.write_text("random\n\nwind=0.1@explore\nblakc@explore\n")
    with pytest.raises(FileError, match=r"faults\.txt:4: unknown fault 'blakc'; did you mean"):
        app.FlightOptions(faults=[f"@{file}"])


NO_SEARCH = "the fault black@search had no effect: the flight did not enter the phase 'search'"


def test_a_fault_that_the_flight_did_not_have_is_among_its_warnings() -> None:
    faults = ["black@search", "black@land+500", "late=0.1@take-off~0.2"]
    report = app.fly("land_only", drone="plain", scene="val-a", faults=faults)
    assert report.outcome == "success"
    too_early = "the fault black@land+500 had no effect: the flight ended too early in the phase"
    assert report.warnings[-2:] == [NO_SEARCH, f"{too_early} 'land'"]


def test_a_drone_with_a_fault_follows_its_flight_once() -> None:
    """Also one that is given as a listener, too."""
    drone = FaultyDrone(PlainConfig(seed=1).create(), Fault.parse("battery-low=0.06@hover+1"))
    around = FaultyDrone(drone, Fault.parse("black@search"))
    report = app.fly("hover_and_look", drone=around, listeners=[lambda _: [drone]])
    assert report.reason == "critical battery: 6 %"
    assert report.warnings[-1:] == [NO_SEARCH]
    wrong = FaultyDrone(PlainConfig().create(), Fault.parse("wind@hoover"))
    for one in (wrong, FaultyDrone(wrong, Fault.parse("black"))):
        with pytest.raises(UnknownNameError, match="'hoover'; did you mean 'hover'"):
            app.fly("hover_and_look", drone=one)


def test_only_leaves_that_become_the_phase_are_phases_of_faults() -> None:
    class Nudge(Leaf):
        moves = True

    text = document('<Sequence><TakeOff/><Nudge name="aside"/><Land/></Sequence>')
    mission = app.check(text, NodeRegistry.installed().with_nodes(Nudge))
    check_phases(mission, [Fault.parse("black@aside"), Fault.parse("black@take-off")])
    for phase in ("TakeOff", "Land", "Nudge"):
        with pytest.raises(UnknownNameError, match=f"'{phase}'"):
            check_phases(mission, [Fault.parse(f"black@{phase}")])


def test_a_real_drone_gets_no_faults() -> None:
    real = ScriptedDrone()
    real.live = True
    with pytest.raises(InputError, match="faults are for simulated drones"):
        with_faults(real, ["wind"])
