"""The output folder of a flight, and the notes of its events."""

from __future__ import annotations

from pathlib import Path

import pytest

from uav_bt.board import ELAPSED
from uav_bt.board.context import MissionContext
from uav_bt.board.flight_folder import FlightFolder
from uav_bt.board.flight_notes import FlightNotes
from uav_bt.errors import FileError
from uav_bt.types.flight_results import EventKind, FlightEvent


def test_it_is_made_with_the_first_file(tmp_path: Path) -> None:
    folder = FlightFolder(tmp_path / "new" / "flight")
    assert not folder.folder.exists()
    folder.write("notes.txt", "read")
    folder.write("image.jpg", b"\x00\x01")
    assert (folder.folder / "notes.txt").read_text(encoding="utf-8") == "read"
    assert (folder.folder / "image.jpg").read_bytes() == b"\x00\x01"


def test_a_folder_with_files_is_refused(tmp_path: Path) -> None:
    (tmp_path / "report.json").write_text("of an earlier flight", encoding="utf-8")
    with pytest.raises(FileError, match=r"has files, .* name another one, or empty this one"):
        FlightFolder(tmp_path)


def test_an_empty_folder_is_used(tmp_path: Path) -> None:
    FlightFolder(tmp_path).write("a.txt", "a")
    assert [file.name for file in tmp_path.iterdir()] == ["a.txt"]


def test_a_file_in_its_place_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("text", encoding="utf-8")
    with pytest.raises(FileError, match="is a file and no folder"):
        FlightFolder(tmp_path / "file")


@pytest.mark.parametrize(
    "name", ["", ".", "..", "../a", "a/b", "a\\b", "/a", ".hidden", "ä", "a\n"]
)
def test_a_name_that_is_no_plain_name_is_refused(name: str, tmp_path: Path) -> None:
    folder = FlightFolder(tmp_path / "out")
    with pytest.raises(FileError, match="expected letters, digits"):
        folder.write(name, "x")
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    folder = FlightFolder(tmp_path, reserved=["report.json"])
    folder.write("a.txt", "first")
    with pytest.raises(FileError, match="exists already"):
        folder.write("a.txt", "second")
    with pytest.raises(FileError, match="name of another output"):
        folder.write("report.json", "{}")
    (tmp_path / "link.txt").symlink_to("nowhere.txt")
    with pytest.raises(FileError, match="exists already"):
        folder.write("link.txt", "x")
    assert (tmp_path / "a.txt").read_text(encoding="utf-8") == "first"
    assert not (tmp_path / "report.json").exists()


def test_events_have_the_time_since_the_take_off() -> None:
    context = MissionContext()
    context.add_event(EventKind.INFO, "before")
    context.board.write(ELAPSED, 12.34567)
    context.add_event(EventKind.WARNING, "later", "M/say")
    assert context.notes.events == [
        FlightEvent(time_s=0.0, kind=EventKind.INFO, text="before"),
        FlightEvent(time_s=12.346, kind=EventKind.WARNING, text="later", node="M/say"),
    ]
    assert str(context.notes.events[1]) == "12.3 s  warning: later"


def test_a_flight_of_endless_messages_keeps_the_first_ones() -> None:
    notes = FlightNotes()
    for number in range(3000):
        notes.add(FlightEvent(time_s=float(number), kind=EventKind.INFO, text="again"))
    assert len(notes.events) == 2001
    assert (
        notes.events[-1].text == "the flight has more than 2000 events: further ones are not kept"
    )
    assert len(notes.take()) == 2001
    assert notes.take() == ()
