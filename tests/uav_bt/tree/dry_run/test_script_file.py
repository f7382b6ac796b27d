"""Script files of dry runs: their content, and refusals with their line."""

from __future__ import annotations

from pathlib import Path

import pytest

from uav_bt.errors import FileError
from uav_bt.tree.dry_run import read_script


def written(folder: Path, text: str) -> Path:
    path = folder / "script.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_everything_that_a_script_can_say_is_read(tmp_path: Path) -> None:
    script = read_script(
        written(
            tmp_path,
            "leaves:\n  TakeOff: RRS\n  Main/step/Explore: (RRS)\n"
            "default: S\n"
            "outputs:\n  Measure: {depth_m: 1.5, text: far}\n"
            "variables: {laps: 3, on: true}\n"
            "board: {phase: explore}\n",
        )
    )
    answers = {selector: (mock.answers, mock.outputs) for selector, mock in script.mocks.items()}
    assert answers == {
        "TakeOff": ("RRS", {}),
        "Main/step/Explore": ("(RRS)", {}),
        "Measure": (None, {"depth_m": 1.5, "text": "far"}),
        "*": ("S", {}),
    }
    places = [mock.place for mock in script.mocks.values()]
    assert [place.position.line for place in places if place] == [2, 3, 6, 4]
    assert script.variables == {"laps": 3, "on": True}
    assert (script.board, script.line("board", "phase")) == ({"phase": "explore"}, 8)


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("", 1, "expected 'leaves' with answers of leaves, or a 'default'"),
        (
            "- a",
            1,
            "expected a mapping with leaves, default, outputs, variables, board, got",
        ),
        ("variables: {a: 1}", 1, "expected 'leaves' with answers of leaves, or a 'default'"),
        ("default: S\nleafs: {}", 2, "leafs: unknown key; did you mean 'leaves'?"),
        ("default: S\nleaves: RRS", 2, "leaves: expected a mapping, got 'RRS'"),
        ("leaves:\n  A: RRX", 2, "a script has the letters R (running), S (success)"),
        ("leaves:\n  A: RRS\n  A: S", 3, "leaves: the key 'A' is given twice"),
        ("leaves:\n  A: [R, S]", 2, "or a number or a text, got a list of 2"),
        ("leaves:\n  [A]: R", 2, "leaves: expected a name before the colon"),
        ("leaves:\n  A:", 2, "leaves.A: expected true or false or"),
        ("default: S\nvariables:\n  day: 2026-13-45", 3, "variables.day: month must be in 1..12"),
        ("default: ()", 1, "a script has the letters"),
        ("leaves: {A: S", 1, "not valid YAML:"),
        ("default: !!python/object:os.system S", 1, "could not determine a constructor"),
    ],
)
def test_what_no_script_can_say_is_refused_with_its_line(
    tmp_path: Path, text: str, line: int, message: str
) -> None:
    path = written(tmp_path, text)
    with pytest.raises(FileError) as error:
        read_script(path)
    assert message in str(error.value)
    assert error.value.line == line


def test_deep_nesting_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="not valid YAML"):
        read_script(written(tmp_path, "[" * 5000))
