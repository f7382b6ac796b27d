"""`uav-bt fly --record`, `uav-bt record`, `replay` and `view`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.worlds.cli import HOP, assert_refused, run, tree_file
from tests.worlds.records import copy_part
from uav_bt.display.rerun import sinks

SMALL = ("--image-size", "160x90", "--profile", "ideal")


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the record of a short flight of the twin."""
    folder = tmp_path_factory.mktemp("flown")
    path = folder / "flight.mcap"
    flight = ("fly", tree_file(folder, HOP), "--scene", "val-a", "--seed", 3, *SMALL)
    result = run(*flight, "--record", path)
    assert result.exit_code == 0, result.output
    assert f"record: {path}" in result.stdout
    return path


def test_info_tells_what_is_in_a_record_to_people_and_machines(record: Path) -> None:
    result = run("record", "info", record)
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith(f"{record}: whole, ")
    for words in ("scene: val-a", "seed: 3", "outcome: success, landed", "/camera/image"):
        assert words in result.stdout
    told = json.loads(run("record", "info", record, "--format", "json").stdout)
    assert (told["finished"], told["damages"]) == (True, [])
    rates = {channel["topic"]: channel["rate_hz"] for channel in told["channels"]}
    assert rates["/mission/tick"] == pytest.approx(10.0, abs=0.5)
    assert {channel["dropped"] for channel in told["channels"]} == {0}


def test_an_unfinished_record_says_so_and_can_be_recovered(record: Path, tmp_path: Path) -> None:
    data = record.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: len(data) * 2 // 3])
    result = run("record", "info", cut)
    assert result.exit_code == 0, result.output
    for words in ("NOT WHOLE", "damage: byte ", "cut within a record", "mcap recover"):
        assert words in result.stdout
    recovered = tmp_path / "recovered.mcap"
    copy_part(cut, recovered)
    assert ": whole, " in run("record", "info", recovered).stdout


def test_a_replay_of_the_same_is_the_same_and_exits_with_0(record: Path) -> None:
    result = run("replay", record)
    assert result.exit_code == 0, result.output
    assert result.stdout.endswith("ticks: 0 differ in statuses, 0 in commands; the same\n")


def test_a_replay_of_something_else_tells_where_it_differs(record: Path, tmp_path: Path) -> None:
    other = HOP.replace('height_m="1.0"', 'height_m="1.4"').replace("<Land/>", "<EmergencyLand/>")
    again = ("replay", record, "--tree", tree_file(tmp_path, other))
    result = run(*again)
    assert result.exit_code == 1, result.output
    assert "only in the recording: Main/Sequence/Land" in result.stdout
    assert "only in the replay: Main/Sequence/EmergencyLand" in result.stdout
    assert "different" in result.stdout.splitlines()[-1]
    result = run(*again, "--format", "json")
    assert result.exit_code == 1, result.output
    told = json.loads(result.stdout)
    assert told["same"] is False
    assert told["differing_ticks"] == len(told["differences"]) > 0


def test_a_view_is_saved(record: Path, tmp_path: Path) -> None:
    view = tmp_path / "flight.rrd"
    result = run("view", record, "--save", view, "--to", 2)
    assert result.exit_code == 0, result.output
    assert result.stdout == f"view: {view}\n"
    assert list(tmp_path.iterdir()) == [view]


def test_where_nothing_can_be_shown_other_ways_are_named(
    record: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file is looked at before the display, and the display before the flight."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(sinks.sys, "platform", "linux")
    assert_refused(run("view", record), "no display", "--web", "--save")
    text, report = tmp_path / "flight.mcap", tmp_path / "report.json"
    text.write_text("no record at all")
    refused = run("view", text)
    assert_refused(refused, str(text))
    assert "display" not in refused.stderr
    flown = run("fly", tree_file(tmp_path, HOP), *SMALL, "--report", report, "--view")
    assert_refused(flown, "no display", "--view web")
    assert not report.exists()
