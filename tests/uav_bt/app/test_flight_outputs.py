"""Outputs of a flight: they overwrite no input, and folder, report and record agree."""

from __future__ import annotations

import json
import logging
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_bridge.plain import PlainConfig
from sim_bridge.twin import TwinConfig
from tests.worlds.records import FLIGHT, NoisyDrone, fly_noisy
from tests.worlds.trees import document, tree_file
from uav_bt import app
from uav_bt.app.drone_of_flight import RehearsedDrone
from uav_bt.app.flight_outputs import fetch_photos, flight_folder
from uav_bt.board.context import FlightFolder
from uav_bt.errors import DroneError, FileError
from uav_bt.lab.shipped import load_lab
from uav_bt.mission.drone_wrapper import DroneWrapper
from uav_bt.protocols import Still, StillCamera, StillState
from uav_bt.record import channels, record_file
from uav_bt.record.reader import RecordReader
from uav_bt.types import Command, TakeOff
from uav_bt.types.flight_results import EventKind

HOP = document("<Sequence><TakeOff/><Land/></Sequence>", tree_id="Hop")
MAIN = '<root BTCPP_format="4" main_tree_to_execute="Hop"><include path="hop.xml"/></root>'
FILES = {
    "hop.xml": HOP,
    "hop.tree": HOP,
    "main.xml": MAIN,
    "main.tree": MAIN.replace("hop.xml", "hop.tree"),
    "scene.yaml": "helipad: {position_m: [0, 0]}\n",
    "flight.mcap": "record",
    "hall.onnx": "\0 network",
    "hall.txt": "network: {model: hall.onnx}\n",
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        Path(name).write_text(text, encoding="utf-8")
    return tmp_path


@pytest.mark.usefixtures("folder")
def test_what_a_flight_reads_is_an_input_whatever_its_suffix() -> None:
    see = document('<Sequence><Segment model="hall.onnx"/><TakeOff/><Land/></Sequence>')
    loaded = app.check("main.xml")
    for tree, how, name in (
        (loaded, {}, "main.xml"),
        (loaded, {}, "hop.xml"),
        ("hop.xml", {"drone": TwinConfig(scene="scene.yaml")}, "scene.yaml"),
        ("main.tree", {"drone": "plain"}, "hop.tree"),
        ("main.tree", {"drone": "plain", "site": "hall.txt"}, "hall.onnx"),
        (see, {"drone": "plain"}, "hall.onnx"),
    ):
        with pytest.raises(FileError, match=f"^{re.escape(name)}: is an input"):
            app.fly(tree, app.FlightOptions(**how), report=name)


@pytest.mark.usefixtures("folder")
def test_report_and_record_are_two_files() -> None:
    os.link("flight.mcap", "report.json")
    with pytest.raises(FileError, match=r"^report.json: .*for the report and for the record"):
        app.fly("hop.xml", app.FlightOptions(record="flight.mcap"), report="report.json")


# --- the output folder ----------------------------------------------------------------------------

PHOTOS = """<root BTCPP_format="4"><BehaviorTree ID="M"><ReactiveSequence name="m">
<Segment/><FindMark/><TrackMotion/><MapSite/>
<Sequence name="s">
  <TakeOff/><Say text="up after {@elapsed_s} s"/>
  <TakePhoto label="first" pitch_deg="-45"/><HelipadCenter/><Land/>
</Sequence></ReactiveSequence></BehaviorTree></root>"""
PLAIN = app.FlightOptions(drone="plain", profile="ideal", scene="val-a")


def test_a_flight_writes_its_results_to_its_folder(folder: Path) -> None:
    flown = app.fly(PHOTOS, PLAIN, out="results/first")
    out = folder / "results" / "first"
    assert flown.outcome == "success"
    assert flown.lost_outputs == {}
    assert {file.name for file in out.iterdir()} == {
        *("report.json", "objects.json", "objects.csv"),
        *("photo-001-first-classes.png", "photo-001-first.json"),
    }
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert report == flown.to_json()
    (photo,) = flown.photos
    assert (photo.label, photo.file, photo.gimbal_pitch_deg) == ("first", None, -45.0)
    said = next(event for event in flown.events if event.kind is EventKind.INFO)
    assert said.text == f"up after {said.time_s:g} s"
    assert report["events"][-1] == {
        "time_s": flown.events[-1].time_s,
        "kind": "ended",
        "text": "the tree succeeded at Land",
        "node": "M/m/s/Land",
    }
    assert flown.objects
    objects = json.loads((out / "objects.json").read_text(encoding="utf-8"))
    assert objects == {"frame": "start", "objects": report["objects"]}
    table = (out / "objects.csv").read_text(encoding="utf-8").splitlines()
    assert table[0] == "id,class_name,x_m,y_m,size_m,width_m,height_m,heading_deg,std_m"
    unknown = [row.split(",")[6] == "" for row in table[1:]]
    assert unknown == [each.height_m is None for each in flown.objects]
    assert len(table) == 1 + len(flown.objects)


def test_a_report_may_lie_elsewhere_and_a_folder_with_files_is_refused(folder: Path) -> None:
    before = {file: file.read_bytes() for file in folder.iterdir()}
    with pytest.raises(FileError, match="has files, and a flight writes to an empty"):
        app.fly("hop.xml", PLAIN, out=folder)
    assert {file: file.read_bytes() for file in folder.iterdir()} == before
    flown = app.fly("hop.xml", PLAIN, out="results", report="told.json")
    assert flown.outcome == "success"
    assert flown.objects is None
    assert (folder / "told.json").is_file()
    assert not (folder / "results").exists()  # neither a map nor a leaf wrote anything


def test_leaves_cannot_take_the_names_of_other_outputs(folder: Path) -> None:
    made = flight_folder(Path("out"), {"record": Path("out/flight.mcap"), "video": None})
    assert made is not None
    for name in ("report.json", "objects.csv", "objects.json", "flight.mcap"):
        with pytest.raises(FileError, match="name of another output"):
            made.write(name, "mine")
    assert not (folder / "out").exists()


# --- photographs of the drone's camera ------------------------------------------------------------

JPEG = b"\xff\xd8 a photograph"
TWO_PHOTOS = """<root BTCPP_format="4"><BehaviorTree ID="M"><ReactiveSequence>
<Rules land_on="any"/><Segment/><TrackMotion/><MapSite/>
<Sequence><TakeOff/><TakePhoto label="a"/><TakePhoto label="b"/>
<ForceSuccess><EmergencyLand/></ForceSuccess></Sequence>
</ReactiveSequence></BehaviorTree></root>"""


class Camera:
    """Saves each photograph at once; some are not handed out."""

    def __init__(self, *lost: str) -> None:
        self.taken = 0
        self.lost = lost
        self.limits_s: list[float] = []

    def take_still(self) -> int:
        self.taken += 1
        return self.taken

    def still(self, number: int) -> Still:
        return Still(state=StillState.SAVED, media=f"m{number}")

    def fetch_still(self, media: str, limit_s: float) -> bytes:
        self.limits_s.append(limit_s)
        if media in self.lost:
            raise DroneError("its web server answers 404")
        return JPEG


class PhotographingDrone(DroneWrapper):
    """The plain drone with a camera for photographs."""

    stills: StillCamera | None = None


def fly(camera: Camera, out: Path) -> app.FlownMission:
    drone = PhotographingDrone(PlainConfig(profile="ideal", scene="val-a").create())
    drone.stills = camera
    assert RehearsedDrone(drone).stills is None
    return app.fly(TWO_PHOTOS, drone=drone, out=out)


def test_photographs_are_fetched_after_the_landing(tmp_path: Path) -> None:
    camera, out = Camera(), tmp_path / "out"
    flown = fly(camera, out)
    files = [photo.camera_file for photo in flown.photos]
    assert files == ["photo-001-a-camera.jpg", "photo-002-b-camera.jpg"]
    assert all((out / str(file)).read_bytes() == JPEG for file in files)
    assert flown.lost_outputs == {}
    assert all(0.0 < limit_s <= 35.0 for limit_s in camera.limits_s)
    camera.limits_s.clear()
    flying = replace(flown, airborne_at_end=True)
    with pytest.raises(FileError, match=r"2 of 2 .*: the drone is still in the air"):
        fetch_photos(flying, camera, FlightFolder(tmp_path / "other"))
    assert camera.limits_s == []


def test_a_photograph_that_is_not_fetched_is_named_in_the_report(tmp_path: Path) -> None:
    camera, out = Camera("m1"), tmp_path / "out"
    flown = fly(camera, out)
    assert flown.outcome == "success"
    (reason,) = flown.lost_outputs.values()
    words = "1 of 2 photographs stay on the drone's memory card (photo-001-a-camera.jpg: media m1)"
    assert f"{words}: its web server answers 404" in reason
    assert (out / "photo-002-b-camera.jpg").read_bytes() == JPEG
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert report["lost_outputs"] == {"camera photographs": reason}


# --- records: correct and complete, also after faults ---------------------------------------------


def test_a_record_tells_what_was_flown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record, report = fly_noisy(tmp_path, monkeypatch)
    reader = RecordReader(record)
    assert reader.finished
    assert (reader.metadata["seed"], reader.metadata["tree"]) == ("5", "mission.xml")
    assert json.loads(reader.metadata["versions"])["numpy"] == np.__version__
    assert reader.metadata["weights"] == "{}"  # this mission loads no network
    assert reader.classes == load_lab().classes
    assert FLIGHT.encode() in reader.attachments["tree/mission.xml"].data
    assert reader.camera == NoisyDrone().camera
    names = [node.name for node in reader.tree.nodes]
    assert names == ["Sequence", "TakeOff", "away", "HoverFor", "back", "Land"]
    assert [node.parent for node in reader.tree.nodes] == [None, 0, 0, 0, 0, 0]
    moments = list(reader.moments())
    assert isinstance(moments[0].commands.sent.movement, TakeOff)
    assert moments[0].statuses == ("RUNNING", "RUNNING", "IDLE", "IDLE", "IDLE", "IDLE")
    assert moments[-1].statuses[0] == "SUCCESS"
    times = [time_ns for _, time_ns, _ in reader.messages()]
    assert times == sorted(times)
    assert times[0] == reader.timeline.start_ns
    assert len(moments) == report.ticks > 10
    assert reader.timeline.since_start(times[-1]) == pytest.approx(
        moments[-1].tick.time_s, abs=1e-9
    )
    end = dict(reader.end or {})
    assert (end["outcome"], json.loads(end["dropped"]), end["lost_ticks"]) == ("success", {}, "0")
    assert json.loads(end["report"])["seed"] == 5


def test_a_fault_in_flight_is_the_records_end(tmp_path: Path) -> None:
    class Broken(NoisyDrone):
        def send(self, command: Command) -> Command:
            if len(self.commands) == 4:
                raise ZeroDivisionError("a rotor")
            return super().send(command)

    record = tmp_path / "flight.mcap"
    with pytest.raises(ZeroDivisionError):
        app.fly(tree_file(tmp_path, FLIGHT), drone=Broken(), record=record)
    reader = RecordReader(record)
    assert reader.finished
    assert reader.end is not None
    assert (reader.end["outcome"], reader.end["reason"]) == ("error", "ZeroDivisionError: a rotor")
    assert len(list(reader.moments())) == 4


def test_what_is_logged_is_in_the_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Talking(NoisyDrone):
        def send(self, command: Command) -> Command:
            logging.getLogger("mine").warning("battery is at %d %%", 42)
            return super().send(command)

    handlers = list(logging.getLogger().handlers)
    record, _ = fly_noisy(tmp_path, monkeypatch, drone=Talking())
    assert logging.getLogger().handlers == handlers
    lines = [data for _, _, data in RecordReader(record).messages([channels.LOG.topic])]
    assert any(b"battery is at 42 %" in line for line in lines)
    assert any(b"phase: take-off" in line for line in lines)


def test_a_disk_that_is_full_from_the_start_is_reported_before_the_flight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def flush(_self: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(record_file.RecordFile, "flush", flush)
    drone = NoisyDrone()
    with pytest.raises(FileError, match="cannot be written: No space left"):
        fly_noisy(tmp_path, monkeypatch, drone=drone)
    assert drone.commands == []
