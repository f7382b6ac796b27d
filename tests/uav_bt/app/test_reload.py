"""Edits of a tree file in flight: valid ones are flown, invalid ones are reported."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from tests.worlds.records import ANYWHERE
from uav_bt import app
from uav_bt.app.assembly import Flight, assemble
from uav_bt.app.reload import TreeReload
from uav_bt.clock import ManualClock
from uav_bt.errors import InputError
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import Drone
from uav_bt.testing import ScriptedDrone

ABOVE = '<Sequence><TakeOff height_m="{height}"/><HoverFor name="{name}" seconds="250"/></Sequence>'
HIGH = ABOVE.format(height=1.0, name="high")


def text(body: str, *, include: str = "") -> str:
    return (
        f'<root BTCPP_format="4" main_tree_to_execute="Main">\n{include}\n'
        f'<BehaviorTree ID="Main">\n{body}\n</BehaviorTree>\n</root>\n'
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "mission.xml"
    path.write_text(text(HIGH), encoding="utf-8")
    return path


class World:
    """A flight of a scripted drone whose tree file is watched."""

    def __init__(self, path: Path) -> None:
        self.clock = ManualClock()
        self.notes: list[str] = []
        drone = ScriptedDrone()
        drone.connect()
        self.flight: Flight[Drone] = assemble(path, drone=drone)
        self.flight.mission.setup(self.flight.context)
        self.reload = TreeReload(self.flight, path, None, self.notes.append, timer=self.clock.now)

    def ask(self, after_s: float = 1.0) -> bool:
        """Poll once, some time after the last poll; return whether there is a new tree."""
        self.clock.advance(after_s)
        before = self.flight.mission
        tree = self.reload()
        assert (self.flight.mission is before) == (tree is None)
        return tree is not None


HIGHER = text(ABOVE.format(height=1.2, name="higher"))


def test_a_good_edit_is_flown_half_a_second_later_at_the_latest(path: Path) -> None:
    """Also one that came before the first look: the loaded content counts."""
    world = World(path)
    path.write_text(HIGHER, encoding="utf-8")
    assert not world.ask(after_s=0.4)
    assert world.ask(after_s=0.2)
    tree = world.flight.mission
    assert tree.is_set_up
    assert tree.find("higher").mission is world.flight.context
    (note,) = world.notes
    assert str(path) in note
    assert not world.ask()


def test_editors_that_rename_are_noticed_and_a_file_that_is_gone_is_waited_for(path: Path) -> None:
    world = World(path)
    backup = path.rename(path.with_suffix(".bak"))
    assert not world.ask()
    new = path.with_suffix(".tmp")
    new.write_text(HIGHER, encoding="utf-8")
    new.rename(path)
    assert world.ask()
    backup.rename(path)
    assert world.ask()
    path.unlink()
    os.mkfifo(path)  # a pipe is not waited for
    assert not world.ask()
    path.unlink()
    other = path.with_suffix(".other")
    other.write_text(HIGHER, encoding="utf-8")
    path.symlink_to(other)
    assert world.ask()


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("<Sequence><TakeOf/></Sequence>", "4:11: TakeOf"),
        ("<Sequence><TakeOff", ":5:1: not well-formed"),
        (ABOVE.format(height=9.0, name="high"), "ceiling"),
        (HIGH.replace("<Hover", '<Rules time_limit_s="60"/><Hover'), "its Rules differ from those"),
        ('<Sequence><Explore policy="none"/></Sequence>', "unknown policy"),
        ("", "mission.xml"),
        (f'<Sequence><Segment model="none.onnx"/>{HIGH}</Sequence>', "none.onnx"),
    ],
)
def test_a_bad_edit_is_reported_once_and_its_cure_flies(path: Path, body: str, words: str) -> None:
    world = World(path)
    path.with_name("none.onnx").write_bytes(b"none")  # only the leaf reads it
    body = body.replace("none.onnx", str(path.with_name("none.onnx")))
    path.write_text(text(body), encoding="utf-8")
    assert not world.ask()
    assert not world.ask()
    (note,) = world.notes
    assert words in note
    assert "flies on" in note
    path.write_text(HIGHER, encoding="utf-8")
    assert world.ask()


def test_included_files_are_watched_those_of_a_refused_edit_too(path: Path) -> None:
    part = path.with_name("part.xml")
    body = '<Sequence><SubTree ID="Part"/></Sequence>'

    def write_part(wait: str) -> None:
        content = text(wait).replace("Main", "Part")
        part.write_text(content.replace(' main_tree_to_execute="Part"', ""), encoding="utf-8")

    world = World(path)
    write_part("<HoverForever/>")
    path.write_text(text(body, include='<include path="part.xml"/>'), encoding="utf-8")
    assert not world.ask()
    assert "part.xml:4" in world.notes[0]
    write_part('<HoverFor seconds="3"/>')
    assert world.ask()
    write_part('<HoverFor seconds="4"/>')
    assert world.ask()
    assert world.flight.mission.sources[part.resolve()] == part.read_bytes()


def test_a_flight_goes_on_with_the_edited_tree(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Clock and board continue; halted leaves propose no more movements."""
    monkeypatch.setattr("uav_bt.app.reload._POLL_S", 0.0)
    land = '<Sequence><TakeOff height_m="1.2"/><HoverFor name="low" seconds="1"/><Land/></Sequence>'
    edits = {60: "<root", 80: text(land)}
    notes, ticks = list[str](), list[TickRecord]()

    class Edits:
        def on_tick(self, record: TickRecord) -> None:
            ticks.append(record)
            if record.index in edits:
                path.write_text(edits[record.index], encoding="utf-8")

    options = app.FlightOptions(drone=ScriptedDrone(), judge=ANYWHERE)
    report = app.fly(path, options, listeners=[lambda _: [Edits()]], watch=notes.append)
    assert report.outcome == "success", report.reason
    assert "The edited tree is refused; the one before it flies on." in notes[0]
    assert notes[1].endswith("the edited tree flies, from its root on")
    names = [tick.active[-1] if tick.active else "" for tick in ticks]
    assert names[75] == "high"  # after the broken edit
    assert "high" not in names[82:]
    assert "low" in names[82:]
    times = [tick.time_s for tick in ticks]
    assert times == sorted(times)
    assert ticks[-20].observation.state.altitude_m == pytest.approx(1.2)
    assert report.ticks == len(ticks)


LIVE = ScriptedDrone()
LIVE.live = True


@pytest.mark.parametrize(
    ("tree", "given", "words"),
    [
        (text(HIGH), {}, "tree file"),
        ("mission.xml", {"drone": LIVE}, "simulated drones only"),
    ],
)
def test_what_cannot_be_watched_is_refused(
    path: Path, monkeypatch: pytest.MonkeyPatch, tree: str, given: dict[str, Any], words: str
) -> None:
    monkeypatch.chdir(path.parent)
    drone = ScriptedDrone()
    with pytest.raises(InputError, match=rf"watch: .*{words}"):
        app.fly(tree, **{"drone": drone, "watch": print, **given})
    assert [file.name for file in path.parent.iterdir()] == ["mission.xml"]
    assert drone.commands == []
