"""The referee's comparison of two folders of answers."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.referee.__main__ import compare, difference
from benchmarks.referee.program import answer, plain


def write(folder: Path, part: str, answers: dict[str, object]) -> Path:
    folder.mkdir(exist_ok=True)
    lines = [json.dumps(row) + "\n" for row in answers.items()]
    (folder / f"{part}.jsonl").write_text("".join(lines), encoding="utf-8")
    return folder


@pytest.mark.parametrize(
    ("after", "code", "printed"),
    [
        ({"Turn": {"least": 1}, "Land": {}}, 0, ["ports: equal"]),
        ({"Turn": {"least": 2}, "Land": {}}, 1, ["1 of 2 differ", "Turn least: before 1, after 2"]),
        ({"Land": {}}, 1, ["ports: equal", "only before: Turn"]),
        ({"Turn": {"least": 1}, "Land": {}, "New": {}}, 1, ["only after: New"]),
    ],
)
def test_what_differs_is_named(
    after: dict[str, object],
    code: int,
    printed: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    before = write(tmp_path / "before", "ports", {"Turn": {"least": 1}, "Land": {}})
    assert compare(before, write(tmp_path / "after", "ports", after), ["ports"]) == code
    out = capsys.readouterr().out
    assert all(words in out for words in printed)


def test_the_first_difference_is_named_by_its_path() -> None:
    one, other = {"a": [{"x": 1}, {"x": 2}]}, {"a": [{"x": 1}, {"x": 3}]}
    assert difference(one, one, "flight") == ""
    assert difference(one, other, "flight") == "flight a 1 x: before 2, after 3"


def test_wall_times_and_words_are_left_out() -> None:
    assert plain({"tick_ms": 3.0, "outcome": "success"}) == {"outcome": "success"}
    failed = answer("check --format json x.xml", 2, "", "Traceback\nError: no such file\n")
    assert failed == {"exit": 2, "said": "Error: no such file", "printed": None}
