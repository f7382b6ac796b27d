"""The referee, on answers that were made up, and on a mission that flies."""

import json
from pathlib import Path

import pytest

from benchmarks.referee.__main__ import compare
from benchmarks.referee.program import answer, plain


def write(folder: Path, **answers: object) -> Path:
    folder.mkdir()
    lines = [json.dumps([name, value]) + "\n" for name, value in answers.items()]
    (folder / "flights.jsonl").write_text("".join(lines))
    return folder


FLOWN = {"exit": 0, "report": {"outcome": "success", "path": [[0.0, 1.5], [0.1, 1.5]]}}


def test_equal_answers_are_equal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before, after = (write(tmp_path / name, land=FLOWN) for name in ("before", "after"))
    assert compare(before, after, ["flights"]) == 0
    assert capsys.readouterr().out == "flights: 0 of 1 differ\n"


def test_the_first_difference_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    later = {"exit": 0, "report": {"outcome": "success", "path": [[0.0, 1.5], [0.1, 1.6]]}}
    before = write(tmp_path / "before", land=FLOWN, hover=FLOWN)
    after = write(tmp_path / "after", land=later, hover=FLOWN)
    assert compare(before, after, ["flights"]) == 1
    line = "  land report path 1 1: before 1.5, after 1.6\n"
    assert capsys.readouterr().out == f"flights: 1 of 2 differ\n{line}"


def test_a_deleted_name_is_listed_apart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = write(tmp_path / "before", land=FLOWN, hover=FLOWN, **{"hover seconds": 1})
    after = write(tmp_path / "after", land=FLOWN)
    assert compare(before, after, ["flights"]) == 1
    assert capsys.readouterr().out == "flights: 0 of 1 differ\n  only before: hover\n"


def test_wall_times_and_words_are_left_out() -> None:
    line = '{"file": "a/b.xml", "findings": [{"message": "no", "line": 3}], "tick_ms": 4.2}\n'
    found = answer("check a/b.xml", 2, line)
    assert found["printed"] == {"a/b.xml": {"file": "b.xml", "findings": [{"line": 3}]}}
    assert plain({"wall_s": 3.0, "node": "Mission/mission/Land"}) == {"node": "Land"}
