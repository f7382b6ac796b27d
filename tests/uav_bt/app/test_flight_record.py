"""Records of flights are correct and complete, also after faults."""

from __future__ import annotations

import json
import logging
from pathlib import Path

import numpy as np
import pytest

from tests.worlds.records import FLIGHT, NoisyDrone, fly_noisy
from tests.worlds.trees import tree_file
from uav_bt import app
from uav_bt.errors import FileError
from uav_bt.lab.shipped import load_lab
from uav_bt.record import channels, record_file
from uav_bt.record.channels import Channel
from uav_bt.record.reader import RecordReader
from uav_bt.types import Command, TakeOff


def test_a_record_tells_what_was_flown_and_how_it_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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


def test_what_the_flight_logs_is_in_the_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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


def test_a_disk_that_fills_up_lands_no_drone_and_the_loss_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    written = record_file.RecordFile.write

    def write(file: record_file.RecordFile, channel: Channel, time_ns: int, data: bytes) -> None:
        if channel is channels.TICK and json.loads(data)["index"] >= 8:
            raise OSError(28, "No space left on device")
        written(file, channel, time_ns, data)

    monkeypatch.setattr(record_file.RecordFile, "write", write)
    record, report = fly_noisy(tmp_path, monkeypatch)
    assert report.outcome == "success"
    assert "record is incomplete: not written to its end: No space left on device" in caplog.text
    assert "ticks lost" in caplog.text
    reader = RecordReader(record)
    assert not reader.finished
    assert reader.end is None
    assert 0 < len(list(reader.moments())) <= 8


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
