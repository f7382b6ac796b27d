"""A whole watched flight: its log and Groot2's view agree with the flight."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from tests.uav_bt.groot.groot_world import GrootClient, free_ports, read_log
from tests.worlds.trees import tree_file
from uav_bt import app, plugins
from uav_bt.groot import watched_live
from uav_bt.mission.tick import TickRecord
from uav_bt.testing import ScriptedDrone
from uav_bt.tree import Status


@dataclass(frozen=True)
class Scripted:
    """A kind of drone by name."""

    def create(self) -> ScriptedDrone:
        return ScriptedDrone()


HOP = '<Sequence><TakeOff height_m="1.0"/><HoverFor seconds="0.5"/><Land/></Sequence>'


@pytest.fixture
def mission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the file of a short mission; the drone `scripted` flies it."""
    found = plugins.load

    def load(group: str, name: str) -> object:
        if (group, name) == (plugins.DRONES, "scripted"):
            return Scripted
        return found(group, name)

    monkeypatch.setattr(plugins, "load", load)
    return tree_file(tmp_path, HOP)


SCRIPTED = app.FlightOptions(drone="scripted", judge=app.JudgeConfig(land_on=app.LandOn.ANY))


def following(watch: Callable[..., Any]) -> app.Listeners:
    return lambda flight: watch(flight.mission, flight.context)


def test_a_flight_is_logged_from_its_first_tick_to_its_end(mission: Path, tmp_path: Path) -> None:
    path = tmp_path / "flight.btlog"
    with watched_live(btlog=path) as listeners:
        report = app.fly(mission, SCRIPTED, listeners=[following(listeners)])
    xml, _, transitions = read_log(path)
    root = ET.fromstring(xml)  # noqa: S314  # written by this test
    names = {int(node.attrib["_uid"]): node.attrib["name"] for node in root.iterfind(".//*[@_uid]")}
    changes: dict[str, list[Status]] = {}
    for _, uid, status in transitions:
        changes.setdefault(names[uid], []).append(status)
    assert list(changes) == ["Sequence", "TakeOff", "HoverFor", "Land"]
    once = [Status.RUNNING, Status.SUCCESS, Status.IDLE]
    assert all(statuses == once for statuses in changes.values())
    assert report.duration_s is not None
    assert transitions[-1][0] / 1e6 == pytest.approx(report.duration_s, abs=0.2)


def test_groot2_sees_the_flight_while_it_goes_on(mission: Path) -> None:
    """A client between ticks gets one running branch, and the board of a drone in the air."""
    seen: list[dict[int, int]] = []
    heights: list[float] = []

    port = free_ports()
    with watched_live(groot=port) as watch, GrootClient(port) as client:

        class Asking:
            def on_tick(self, _: TickRecord) -> None:
                seen.append(client.statuses())
                heights.append(client.boards("Main")["Main"]["@height_above_ground_m"])

        asking = [following(watch), lambda _: [Asking()]]
        report = app.fly(mission, SCRIPTED, listeners=asking)
    assert len(seen) == report.ticks
    assert seen[0] == {1: 1, 2: 1, 3: 0, 4: 0}
    assert any(statuses == {1: 1, 2: 2, 3: 1, 4: 0} for statuses in seen)
    assert seen[-1] == {1: 12, 2: 12, 3: 12, 4: 12}
    assert max(heights) == pytest.approx(1.0, abs=0.2)
