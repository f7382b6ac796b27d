"""The drone without images: its flights repeat, its perception has the errors that it states."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_bridge.anafi import anafi_camera
from sim_bridge.plain import PlainConfig
from sim_bridge.plain.caster import Caster
from sim_bridge.plain.drone import PlainDrone
from sim_bridge.plain.sight import MOTION_STD, SIZE_PX, see_mark
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import Helipad, ObjectSpec
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views
from tests.paper_lab import CARPET
from tests.sim_bridge.twin.lab_world import lens
from tests.worlds import values
from uav_bt import app
from uav_bt.app.replay import replay
from uav_bt.errors import FileError, InputError
from uav_bt.landing_marks import MarkSighting, MarkView
from uav_bt.mission.judge import JudgeConfig
from uav_bt.plugins import make_mark_finder
from uav_bt.protocols import Drone, Imageless, Referee, Sight
from uav_bt.types import Command, Frame, GimbalTo, MoveBy, TakeOff

pytestmark = pytest.mark.flight
Flown = tuple[PlainDrone, list[Frame], Sight, Referee]


@pytest.fixture(scope="module")
def flown() -> Iterator[Flown]:
    """Yield a drone and the frames of a flight: take off, look down, fly a turn."""
    drone = PlainConfig(scene="val-a", seed=2, profile="ideal").create()
    assert isinstance(drone, Drone)
    assert isinstance(drone, Imageless)
    drone.connect()
    frames = []
    for tick in range(90):
        if (frame := drone.observe().frame) is not None:
            frames.append(frame)
        movement = TakeOff() if tick < 45 else MoveBy(id=1, forward_m=1.0, yaw_rad=0.8)
        drone.send(Command(movement=movement, gimbal=GimbalTo(pitch_rad=-0.6)))
        drone.clock.sleep_until(0.1 * (tick + 1))
    assert isinstance(drone.sight, Sight)
    assert isinstance(drone.referee, Referee)
    yield drone, frames, drone.sight, drone.referee
    drone.disconnect()


def report(tree: str, seed: int = 3, **options: Any) -> dict[str, Any]:
    """Return a flight's report without times of the computer."""
    flown = app.fly(tree, **{"drone": "plain", "seed": seed, **options}).to_json()
    timed = ("slow_leaves", *(name for name in flown if name.endswith("_ms")))
    return {name: value for name, value in flown.items() if name not in timed}


def test_a_flight_repeats_and_another_seed_is_another_flight() -> None:
    first = report("land_only", scene="val-a")
    assert first["outcome"] == "success"
    assert report("land_only", scene="val-a") == first
    assert report("land_only", seed=4, scene="val-a") != first


def test_a_lab_with_other_names_and_ids_of_classes_gives_the_same_flight() -> None:
    scene = load_scene("val-a")
    other = replace(scene, lab=str(Path(__file__).parents[2] / "labs" / "renamed"))
    assert other.classes.ground != scene.classes.ground
    judge = JudgeConfig(time_limit_s=12.0)
    flights = [
        report("survey_and_land", drone=PlainConfig(scene=each, seed=3), judge=judge)
        for each in (scene, other)
    ]
    names = [[each.pop("class_name") for each in flown["objects"]] for flown in flights]
    assert [name.replace("box", "drum") for name in names[0]] == names[1] != []
    assert [flown.pop("lab") for flown in flights] == ["paper", "renamed"]
    assert flights[0] == flights[1]


def test_class_maps_are_exact_but_at_borders_and_depths_but_for_a_factor(flown: Flown) -> None:
    _, frames, sight, referee = flown
    ids = sight.segment(frames[60]).ids
    exact = referee.class_ids(frames[60], *ids.shape[::-1])
    assert 0.001 < np.mean(ids != exact) < 0.05
    assert np.mean(ids == CARPET) == pytest.approx(np.mean(exact == CARPET), abs=0.02)
    factors = sight.estimate(frames[60]).depth / referee.depth(frames[60], *SIZE_PX)
    middle = np.median(factors)
    assert 0.2 < middle < 0.4
    assert np.mean(np.abs(factors / middle - 1.0) < 0.05) > 0.9


def test_the_measured_motion_has_the_stated_error(flown: Flown) -> None:
    """Beside the true motion of the lens; None where a frame was not perceived."""
    drone, frames, sight, _ = flown
    off, unseen = [], 0
    for before, after in itertools.pairwise(frames):
        sight.segment(after)
        found = sight.motion(before, after)
        if found is None:
            unseen += 1
            continue
        first, second = (drone.simulation.capture_of(each.index).camera for each in (before, after))
        forward_m, left_m = first.to_body(second.x_m, second.y_m)
        off.append((found.x_m - forward_m, found.y_m + left_m))
    assert len(off) > 30
    assert np.std(off) == pytest.approx(MOTION_STD[0], rel=0.3)
    assert unseen == 1
    # Late frames go back in time once; the next pair has both shares of ground again.
    for frame in frames[-13:-10]:
        sight.segment(frame)
    assert sight.motion(frames[-12], frames[-11]) is not None


KIND = {"kind": "apriltag", "options": {"id": 7, "size_m": 0.3}}
TAG = Helipad(position_m=(1.0, 0.5), yaw_deg=20.0, size_m=(0.5, 0.5, 0.2), **KIND)
COVER = ObjectSpec(kind="box-1", position_m=(0.0, 0.5), size_m=(0.3, 0.4, 1.4))
ROOM = Scene(name="mark", helipad=TAG, objects=(COVER,))
BESIDE = (2.4, -0.6, 1.5, 140.0, -38.0)


def sighted(camera: CameraPose, seed: int = 0) -> MarkSighting | None:
    _, depth_m = Caster(ROOM, SIZE_PX).cast(camera)
    return see_mark(TAG, camera, depth_m, np.random.default_rng(seed))


@pytest.mark.parametrize(
    ("at", "visible"),
    [
        (BESIDE, True),
        ((1.2, -1.2, 1.3, 95.0, -30.0), True),
        ((1.0, 0.4, 2.0, 20.0, -90.0), True),
        ((2.4, -0.6, 1.5, -40.0, -38.0), False),  # behind
        ((2.4, -0.6, 1.5, 140.0, 0.0), False),  # below the view
        ((-0.88, -0.18, 0.35, 20.0, -5.0), False),  # too flat
        ((-1.0, 0.5, 1.0, 0.0, -20.0), False),  # behind the box
    ],
)
def test_a_mark_is_sighted_as_a_finder_sees_it_in_the_image(
    at: tuple[float, float, float, float, float], *, visible: bool
) -> None:
    camera = lens(*at)
    (view,) = render_views(ROOM, [camera])
    frame = values.frame(view.image, camera.pitch_rad, camera.z_m)
    found = make_mark_finder(TAG.mark).find(MarkView(frame=frame, camera=anafi_camera(640, 360)))
    seen = sighted(camera)
    assert (found is not None) == (seen is not None) == visible
    if found and seen:
        for name in ("forward_m", "right_m", "height_m"):
            assert getattr(seen, name) == pytest.approx(getattr(found, name), abs=0.08)
        off_deg = math.remainder(seen.heading_deg - found.heading_deg, 360.0)
        assert off_deg == pytest.approx(0.0, abs=2)


def test_sightings_have_the_stated_errors() -> None:
    """Of a tag of full confidence: 0.3 degrees of heading, and a hundredth of the range."""
    found = [sighted(lens(*BESIDE), seed) for seed in range(300)]
    headings, ranges_m = np.array([(each.heading_deg, each.range_m) for each in found]).T
    assert {each.confidence for each in found} == {1.0}
    assert np.std(headings) == pytest.approx(0.3, rel=0.15)
    assert np.std(ranges_m) / np.mean(ranges_m) == pytest.approx(0.01, rel=0.15)


def test_a_mission_that_looks_at_images_is_refused() -> None:
    with pytest.raises(InputError, match="this drone has none; fly the mission with --drone twin"):
        app.fly("explore_and_land_student", drone="plain")


def test_its_record_cannot_be_replayed(tmp_path: Path) -> None:
    record = tmp_path / "flight.mcap"
    app.fly("land_only", drone="plain", scene="val-a", seed=3, record=record)
    with pytest.raises(FileError, match=r"flight\.mcap: was flown without images"):
        replay(record)
