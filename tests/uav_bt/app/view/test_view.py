"""Views of flights: live, from records, in files and films; bad records are refused."""

from __future__ import annotations

import subprocess
from pathlib import Path

import av
import pytest

from tests.uav_bt.app.view.recorded_world import MISSION, OPTIONS, Seen
from tests.worlds.trees import tree_file
from uav_bt import app
from uav_bt.app.view import recorded
from uav_bt.app.view.live import saved_view
from uav_bt.app.view.recorded import RecordedFlight
from uav_bt.display.rerun import sinks
from uav_bt.errors import FileError, TreeError

ENTITIES = (
    *("/world/lab/things", "/world/path", "/world/camera/image"),
    *("/mask/ids", "/tree", "/words", "/plots/height/telemetry", "/plots/tick_time/compute"),
)


def contents(path: Path) -> str:
    """Return the content of a file as Rerun's program reads it, without a warning."""
    program = sinks.viewer_command(1, None)[0]
    told = subprocess.run(  # noqa: S603  # the program of Rerun's wheel
        [program, "rrd", "print", str(path)], capture_output=True, text=True, check=True
    )
    assert "WARN" not in told.stderr
    return told.stdout


def test_a_record_becomes_a_file_that_rerun_reads(flown: tuple[Path, Seen], tmp_path: Path) -> None:
    steps: list[tuple[str, int, int]] = []
    flight = RecordedFlight(flown[0], from_s=2.0, to_s=4.0)
    flight.save(tmp_path / "flight.rrd", advance=lambda *told: steps.append(told))
    assert flight.facts.title == "mission in val-a, seed 4"
    assert flight.damages == ()
    told = contents(tmp_path / "flight.rrd")
    assert all(entity in told for entity in ENTITIES)
    assert "log_time" not in told  # the mission's time alone
    assert steps[-1] == ("view", 20, 20)


def test_a_record_becomes_a_film_with_its_outcome(flown: tuple[Path, Seen], tmp_path: Path) -> None:
    flight = RecordedFlight(flown[0], to_s=1.0)
    flight.film(tmp_path / "flight.mp4")
    with av.open(str(tmp_path / "flight.mp4")) as container:
        pictures = sum(1 for _ in container.decode(video=0))
    assert pictures >= 10 + 20  # the ticks, and the outcome for two seconds


def test_a_record_knows_tree_and_lab(flown: tuple[Path, Seen]) -> None:
    flight = RecordedFlight(flown[0])
    facts = flight.facts
    assert flight.tree is not None
    assert [path for path, _ in facts.nodes] == [node.path for node in flight.tree.nodes()]
    assert facts.camera == flight.reader.camera
    assert facts.lab_map is not None
    assert len(facts.lab_map.boxes) > 0
    assert (facts.makes_depth, facts.intruding) == (False, None)


@pytest.mark.parametrize("lost", ["tree", "lab"])
def test_a_record_is_shown_without_the_nodes_or_the_lab_that_are_not_here(
    lost: str, flown: tuple[Path, Seen], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise TreeError("x.xml", ["no such node"]) if lost == "tree" else FileError("x", "no file")

    loader = "load_tree" if lost == "tree" else "load_scene"
    monkeypatch.setattr(recorded, loader, refuse)
    flight = RecordedFlight(flown[0], to_s=0.5)
    flight.save(tmp_path / "flight.rrd")
    assert (flight.tree is None) == (lost == "tree")
    assert (flight.facts.lab_map is None) == (lost == "lab")
    assert len(flight.facts.nodes) > 5


def test_a_part_without_a_tick_is_refused(flown: tuple[Path, Seen], tmp_path: Path) -> None:
    flight = RecordedFlight(flown[0], from_s=500.0)
    with pytest.raises(FileError, match="no tick"):
        flight.save(tmp_path / "flight.rrd")
    assert list(tmp_path.iterdir()) == []


def test_a_record_that_was_cut_short_is_shown_as_far_as_it_goes(
    flown: tuple[Path, Seen], tmp_path: Path
) -> None:
    whole = flown[0].read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) // 2])
    flight = RecordedFlight(cut)
    flight.save(tmp_path / "cut.rrd")
    assert flight.damages[0] == "it was never finished"
    assert "/world/path" in contents(tmp_path / "cut.rrd")


def test_nobody_draws_for_a_viewer_that_was_closed(flown: tuple[Path, Seen]) -> None:
    import rerun as rr  # noqa: PLC0415 - only this draws into memory

    steps: list[int] = []
    RecordedFlight(flown[0]).draw(
        rr.RecordingStream("test"),
        advance=lambda _, done, __: steps.append(done),
        stopped=lambda: len(steps) == 3,
    )
    assert steps == [1, 2, 3]


def test_a_flight_is_drawn_while_it_is_flown(tmp_path: Path) -> None:
    with saved_view(tmp_path / "live.rrd", title="tour") as view:
        app.fly(tree_file(tmp_path, MISSION), OPTIONS, listeners=[view])
    told = contents(tmp_path / "live.rrd")
    assert all(entity in told for entity in ENTITIES)
