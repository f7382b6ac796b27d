"""`uav-bt view`: views of records, and refusals."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.worlds.cli import HOP, assert_refused, run, tree_file
from uav_bt.display.rerun import sinks

QUICK = ("--image-size", "160x90", "--profile", "ideal", "--scene", "val-a")


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the record of a hop."""
    folder = tmp_path_factory.mktemp("record")
    result = run("fly", tree_file(folder, HOP), *QUICK, "--record", folder / "flight.mcap")
    assert result.exit_code == 0, result.output
    return folder / "flight.mcap"


@pytest.fixture(autouse=True)
def no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(sinks.sys, "platform", "linux")


def test_without_a_display_other_ways_are_named(record: Path) -> None:
    assert_refused(run("view", record), "no display", "--web", "--save")


def test_a_flight_cannot_be_shown_without_a_display(tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    flown = run("fly", tree_file(tmp_path, HOP), *QUICK, "--report", report, "--view")
    assert_refused(flown, "no display", "--view web")
    assert not report.exists()


def test_a_file_is_looked_at_before_the_display() -> None:
    refused = run("view", Path(__file__))
    assert_refused(refused, __file__)
    assert "no display" not in refused.stderr
