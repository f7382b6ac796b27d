"""Flights in a lab: `--lab` and `FlightOptions(lab=)`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from tests.uav_bt.learning.lab_world import write_colour_network
from tests.worlds.labs import HALL, MARK, SCENE, lab_folder
from tests.worlds.records import ANYWHERE, FLIGHT, NoisyDrone
from tests.worlds.trees import document
from uav_bt import app
from uav_bt.app.drone_of_flight import CalibratedDrone
from uav_bt.app.place import limits_of
from uav_bt.app.replay import ReplayOptions
from uav_bt.app.replay.replayer import assemble_recorded
from uav_bt.app.site import network_of
from uav_bt.errors import FileError, InputError
from uav_bt.lab.shipped import load_lab
from uav_bt.mission.limits import Limits
from uav_bt.record.reader import RecordReader
from uav_bt.testing import ScriptedDrone
from uav_bt.types import Airframe, Pose2D

MakeLab = Callable[..., Path]


@pytest.fixture
def make_lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> MakeLab:
    """Return a function that makes a lab in `labs/` of the working directory."""
    monkeypatch.chdir(tmp_path)

    def make(keys: str = MARK, *, name: str = "hall", scenes: tuple[str, ...] = ()) -> Path:
        return lab_folder(Path("labs") / name, HALL + keys, scenes=scenes)

    return make


def test_a_lab_is_found_by_name_by_folder_and_by_object(make_lab: MakeLab) -> None:
    folder = make_lab("flight_height_m: 1.1\n")
    for lab in ("hall", folder, folder / "lab.yaml", load_lab("hall")):
        options = app.FlightOptions(lab=lab)
        assert options.place is not None
        assert (options.place.lab, options.place.flight_height_m) == ("hall", 1.1)
        assert replace(options, seed=1).place == options.place
    with pytest.raises(InputError, match="both say how the place is flown"):
        app.FlightOptions(lab="hall", site=app.Site())


def test_a_real_drone_flies_with_the_settings_of_the_lab(make_lab: MakeLab) -> None:
    keys = (
        f"{MARK}flight_height_m: 1.1\nlimits: {{ceiling_m: 2.0}}\nmargins: {{obstacle_m: 0.5}}\n"
        'take_off: {position_m: [0, 0.5], yaw_deg: 90}\narea: "lab:-1,-1;lab:2,-1;lab:2,2;lab:-1,2"'
    )
    make_lab(keys)
    flight = app.assemble("land_only", drone=ScriptedDrone(), lab="hall")
    context = flight.context
    assert context.classes.names == ("wall", "floor", "pad", "side", "drum", "lid")
    assert (context.mark.length_m, context.mark.height_m) == (0.6, 0.05)
    assert context.take_off == Pose2D(x_m=0.0, y_m=0.5, yaw_rad=pytest.approx(1.5708, abs=1e-4))
    assert context.mark_pose == Pose2D(x_m=1.0, y_m=0.5, yaw_rad=0.0)
    assert context.clearances.obstacle_m == 0.5
    assert flight.mission.find("TakeOff").port_value("height_m") == 1.1
    assert flight.held.area is not None
    assert flight.held.area.margin_m(0.0, 0.0) == pytest.approx(1.0)
    assert flight.held.area.margin_m(1.4, 0.0) == pytest.approx(0.1)  # ahead is up the drawing


def test_a_lab_without_a_mark_or_with_a_narrow_margin_is_refused(make_lab: MakeLab) -> None:
    make_lab("")
    drone = ScriptedDrone()
    with pytest.raises(InputError, match="the lab 'hall' has no landing mark"):
        app.assemble("land_only", drone=drone, lab="hall")
    app.assemble("land_only", drone=drone, lab="hall", judge=ANYWHERE)
    with pytest.raises(InputError, match=r"the lab 'hall' has no scene.*labs/hall/scenes/NAME"):
        app.assemble("land_only", drone="plain", lab="hall")
    make_lab(f"{MARK}margins: {{edge_m: 0.1}}\n")
    with pytest.raises(FileError, match=r"labs/hall/lab.yaml:10: margins.edge_m: must be at least"):
        app.assemble("land_only", drone=drone, lab="hall")


def test_the_camera_of_a_lab_is_that_of_its_real_drone(make_lab: MakeLab) -> None:
    (make_lab(scenes=("one",)) / "camera.yaml").touch()
    make_lab(f"{MARK}camera: camera.yaml\n")
    for drone, calibrated in ((ScriptedDrone(), True), ("plain", False)):
        made = app.make_drone(app.FlightOptions(drone=drone, lab="hall"))
        assert isinstance(made, CalibratedDrone) == calibrated


@pytest.mark.parametrize(
    ("given", "flown"),
    [
        (None, Limits(speed_mps=2.0, ceiling_m=3.0, critical_battery=0.2)),
        (Limits(), Limits(critical_battery=0.2)),
        (Limits(speed_mps=1.0, ceiling_m=3.5), Limits(ceiling_m=3.0, critical_battery=0.2)),
        (
            Limits(speed_mps=2.5, climb_mps=0.2, floor_m=0.5, critical_battery=0.3, blind_s=5.0),
            Limits(speed_mps=2.0, climb_mps=0.2, floor_m=0.5, critical_battery=0.3, blind_s=5.0),
        ),
    ],
)
def test_the_smaller_limits_of_options_and_lab_hold(
    make_lab: MakeLab, given: Limits | None, flown: Limits
) -> None:
    make_lab(f"{MARK}limits: {{speed_mps: 2.0, ceiling_m: 3.0}}\nbattery: {{critical: 0.2}}\n")
    assert limits_of(app.FlightOptions(lab="hall", limits=given)) == flown


def test_the_first_scene_of_the_lab_is_flown_unless_one_is_named(make_lab: MakeLab) -> None:
    make_lab("mark: {size_m: [1, 1], height_m: 0.3}\n", scenes=("west", "east"))
    for asked, name in ((None, "east"), ("west", "west"), ("labs/hall/scenes/west.yaml", "west")):
        flight = app.assemble("land_only", drone="plain", lab="hall", scene=asked)
        assert flight.scene_name == name
        assert flight.held.classes.names[1] == "floor"
        assert flight.held.lab is not None
        assert flight.held.lab.name == "hall"
        assert flight.context.mark.height_m == 0.05  # of the scene, and not of the lab
    assert app.assemble("land_only", drone="plain", lab="paper").scene_name == "train-a"
    assert app.assemble("land_only", drone="plain", lab="depot").scene_name == "depot-test-a"


def test_a_scene_of_another_lab_is_refused(
    make_lab: MakeLab, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = make_lab(scenes=("one", "two")).resolve()
    words = r"scene 'val-a' belongs to the lab 'paper'.*lab 'hall': choose one .*\(one, two\)"
    with pytest.raises(InputError, match=words):
        app.assemble("land_only", drone="plain", lab="hall", scene="val-a")
    other = tmp_path / "other.yaml"
    other.write_text(f"lab: hall\n{SCENE}")
    assert app.assemble("land_only", drone="plain", lab="hall", scene=other).scene_name == "other"
    with pytest.raises(InputError, match=r"'other' belongs to the lab 'hall'"):
        app.assemble("land_only", drone="plain", lab="paper", scene=other)
    # One in the folder of a lab belongs to it from everywhere, also if it states the lab's name.
    (folder / "scenes" / "two.yaml").write_text(f"lab: hall\n{SCENE}")
    monkeypatch.chdir(tmp_path.parent)
    for name in ("one", "two"):
        flight = app.assemble("land_only", drone="plain", scene=folder / "scenes" / f"{name}.yaml")
        assert flight.held.classes.names[1] == "floor"


TAG = "kind: apriltag, options: {id: 7, size_m: 0.4}"
BY_TAG = """
<ReactiveSequence>
  <SubTree ID="Perceive"/>
  <Sequence>
    <TakeOff height_m="1.5"/><Turn degrees="360"/><GoTo to="lab:-1,-0.5@0"/>
    <ForceSuccess><EmergencyLand/></ForceSuccess>
  </Sequence>
</ReactiveSequence>
"""


def test_a_place_of_the_drawing_is_reached_by_the_tag_of_the_lab(make_lab: MakeLab) -> None:
    """The take-off is random, and the lab states where its tag stands."""
    pose = "position_m: [1.2, 0.8], yaw_deg: 30"
    folder = make_lab(f"mark: {{{TAG}, size_m: [0.5, 0.5], height_m: 0.1, {pose}}}\n")
    (folder / "scenes" / "one.yaml").write_text(
        f"helipad: {{{TAG}, size_m: [0.5, 0.5, 0.1], {pose}}}\ntake_off: {{from: random}}\n"
    )
    flown = app.fly(document(BY_TAG), drone="plain", lab="hall", seed=3, judge=ANYWHERE)
    x_m, y_m = flown.path[-1, 1:3]
    assert math.hypot(x_m + 1.0, y_m + 0.5) < 0.2


SEES = FLIGHT.replace("<TakeOff", "<Segment/><TakeOff", 1)
"""A flight with the lab's network."""


def test_report_record_and_replay_keep_the_lab(make_lab: MakeLab, tmp_path: Path) -> None:
    folder = make_lab(
        f"{MARK}margins: {{obstacle_m: 0.5}}\ntake_off: {{yaw_deg: 90}}\n"
        "limits: {speed_mps: 0.4}\nground: [wall]\n"
    )
    write_colour_network(folder / "segmentation.onnx", order=(0, 1, 2, 3, 3, 3))
    record, drone = tmp_path / "flight.mcap", NoisyDrone()
    drone.airframe = Airframe(body_size_m=(0.4, 0.4, 0.12), command_delay_s=0.3)
    report = app.fly(document(SEES), drone=drone, lab="hall", record=record, judge=ANYWHERE)
    reader = RecordReader(record)
    assert (report.lab, reader.metadata["lab"]) == ("hall", "hall")
    assert "segmentation.onnx" in reader.metadata["weights"]
    assert reader.attachments["lab.yaml"].data == (folder / "lab.yaml").read_bytes()
    replayed, _ = assemble_recorded(reader, ReplayOptions())
    context = replayed.context
    assert replayed.drone.airframe == drone.airframe
    assert context.classes.names[1] == "floor"
    assert (context.mark.height_m, context.clearances.obstacle_m) == (0.05, 0.5)
    assert (context.ground, context.take_off) == (("wall",), replayed.options.site.take_off_pose)
    assert replayed.options.site.limits.speed_mps == 0.4
    other = write_colour_network(folder / "other.onnx", order=(0, 1, 2, 3, 3, 3))
    make_lab(f"{MARK}network: {{model: other.onnx}}\n")  # it takes precedence
    assert load_lab("hall").network["model"] == str(other)


def test_a_mission_that_does_not_fit_a_lab_is_refused(make_lab: MakeLab) -> None:
    make_lab(f'{MARK}area: "start:-1,-1;start:1,-1;start:1,1;start:-1,1"\n')
    with pytest.raises(InputError, match="must not lie on one line"):
        app.check(document('<Rules area="start:0,0;start:0,1;start:0,2"/>'), lab="hall")


def test_a_tree_that_does_not_segment_flies_in_a_lab_with_a_network(
    make_lab: MakeLab, caplog: pytest.LogCaptureFixture
) -> None:
    write_colour_network(make_lab() / "segmentation.onnx")
    app.check(document(FLIGHT), lab="hall")
    assert not caplog.messages
    make_lab(f"{MARK}network: {{model: segmentation.onnx}}\n")
    app.check(document(FLIGHT), lab="hall")
    assert "has no effect" in caplog.messages[0]


def test_a_lab_without_a_network_is_flown_with_the_one_for_any_room(make_lab: MakeLab) -> None:
    folder, tree = make_lab(scenes=("one",)), document(SEES)
    assert network_of(load_lab(folder)) == {"model": "any", "depth": "any"}
    report = app.fly(tree, drone=NoisyDrone(), lab="hall", judge=ANYWHERE)
    assert report.outcome == "success"
    for _ in range(2):  # a scene alone does not bring the lab's network
        with pytest.raises(InputError, match=r"does not have the classes .* add --lab .*hall"):
            app.fly(tree, scene=folder / "scenes" / "one.yaml")
        write_colour_network(folder / "segmentation.onnx", order=(0, 1, 2, 3, 3, 3))
