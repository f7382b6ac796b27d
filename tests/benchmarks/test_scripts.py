"""Scripts that measure what the pages state."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from benchmarks import landing_marks
from benchmarks.mission_pages import IMAGES, NAMES, ROOT, drawing, flight_part, with_part
from benchmarks.referee.__main__ import compare
from benchmarks.referee.program import answer, plain
from sim_bridge.twin.scene_file import load_scene
from uav_bt.plugins import make_mark_finder

SCRIPTS = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for folder in ("", "rooms", "real_rooms")
    for path in (ROOT / "benchmarks" / folder).glob("*.py")
    if not path.name.startswith("loopback")  # run by the Python that has Olympe
    and 'if __name__ == "__main__"' in path.read_text(encoding="utf-8")
)
NAMED = re.compile(r"(?<![\w/])benchmarks(?:(?:/[\w-]+)+\.\w+|(?:\.\w+)+)")


def texts() -> Iterator[Path]:
    yield from (path for path in ROOT.glob("*.md") if path.name != "CHANGELOG.md")
    for folder in ("docs", "uav_bt", "perception", "behaviours", "sim_bridge"):
        yield from (ROOT / folder).rglob("*.md")
        yield from (ROOT / folder).rglob("*.py")


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_tells_its_usage(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", [name, "--help"])
    with pytest.raises(SystemExit) as ended:
        import_module(name).main()
    assert ended.value.code == 0
    assert "usage:" in capsys.readouterr().out


def test_each_named_script_exists() -> None:
    missing = []
    for path in texts():
        for name in NAMED.findall(path.read_text(encoding="utf-8")):
            file = ROOT / (name if "/" in name else f"{name.replace('.', '/')}.py")
            if not file.exists() and not (file.with_suffix("") / "__main__.py").exists():
                missing.append(f"{path.relative_to(ROOT)}: {name}")
    assert missing == []


# --- generated parts of the pages of missions -----------------------------------------------------

FLOWN = {"scene": "val-a", "seed": 7, "outcome": "success", "reason": "landed", "profile": "harsh"}
FOUND = {"objects_found": 6, "objects_total": 8, "false_objects": 1, "photos": [{}, {}]}
FIGURES = {"min_clearance_m": 0.318, "landing_error_m": 0.0414, "total_distance_m": 7.77}
REPORT: dict[str, Any] = {**FLOWN, **FOUND, **FIGURES, "duration_s": 61.23}


@pytest.mark.parametrize("name", NAMES)
def test_a_mission_has_todays_drawing_a_film_and_a_row_in_the_index(name: str) -> None:
    remedy = "run: python -m benchmarks.mission_pages --drawings"
    assert (IMAGES / f"{name}.svg").read_text(encoding="utf-8") == drawing(name), remedy
    assert (IMAGES / f"{name}.webp").stat().st_size <= 600_000
    page = (ROOT / "docs" / "missions" / f"{name}.md").read_text(encoding="utf-8")
    assert f"(../images/missions/{name}.svg)" in page
    index = (ROOT / "docs" / "missions.md").read_text(encoding="utf-8")
    assert f"| [{name}](missions/{name}.md) |" in index


def test_the_part_of_a_flight_has_figures_and_their_source() -> None:
    part = flight_part(REPORT, "patrol_and_photograph", speed=4.26, source="Commit `1234567`.\n")
    assert (
        "| `val-a`, 7 | success: landed | 61.2 s | 7.8 m | 2 | 6 of 8, 1 false | 0.32 m | 0.041 m |"
    ) in part
    assert "4.3 times as fast" in part
    assert "\nCommit `1234567`.\n" in part


def test_a_mission_that_lands_beside_the_mark_has_no_landing_error() -> None:
    part = flight_part(REPORT | {"photos": []}, "land_elsewhere", speed=1.0, source="")
    assert "landing error" not in part
    assert "photographs" not in part


def test_a_part_is_replaced_and_the_rest_of_the_page_stays(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("a\n<!-- flight -->\nold\n<!-- end -->\nb\n<!-- drawing -->\nc\n<!-- end -->\n")
    assert with_part(page, "flight", "new\n") == (
        "a\n<!-- flight -->\nnew\n<!-- end -->\nb\n<!-- drawing -->\nc\n<!-- end -->\n"
    )


# --- the referee ----------------------------------------------------------------------------------


def write(folder: Path, **answers: object) -> Path:
    folder.mkdir()
    lines = [json.dumps([name, value]) + "\n" for name, value in answers.items()]
    (folder / "flights.jsonl").write_text("".join(lines))
    return folder


ANSWER = {"exit": 0, "report": {"outcome": "success", "path": [[0.0, 1.5], [0.1, 1.5]]}}


def test_the_first_difference_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    later = {"exit": 0, "report": {"outcome": "success", "path": [[0.0, 1.5], [0.1, 1.6]]}}
    before = write(tmp_path / "before", land=ANSWER, hover=ANSWER)
    after = write(tmp_path / "after", land=later, hover=ANSWER)
    assert compare(before, after, ["flights"]) == 1
    line = "  land report path 1 1: before 1.5, after 1.6\n"
    assert capsys.readouterr().out == f"flights: 1 of 2 differ\n{line}"


def test_a_deleted_name_is_listed_apart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = write(tmp_path / "before", land=ANSWER, hover=ANSWER, **{"hover seconds": 1})
    after = write(tmp_path / "after", land=ANSWER)
    assert compare(before, after, ["flights"]) == 1
    assert capsys.readouterr().out == "flights: 0 of 1 differ\n  only before: hover\n"


def test_wall_times_and_words_are_left_out() -> None:
    line = '{"file": "a/b.xml", "findings": [{"message": "no", "line": 3}], "tick_ms": 4.2}\n'
    found = answer("check a/b.xml", 2, line)
    assert found["printed"] == {"a/b.xml": {"file": "b.xml", "findings": [{"line": 3}]}}
    assert plain({"wall_s": 3.0, "node": "Mission/mission/Land"}) == {"node": "Land"}


# --- the measurement of landing marks -------------------------------------------------------------


@pytest.mark.parametrize("name", landing_marks.MARKS.split(","))
def test_each_mark_stands_in_its_scenes(name: str, tmp_path: Path) -> None:
    landing_marks.write_scene(name, 3, tmp_path)
    scene = load_scene(str(tmp_path / f"{name}-3.yaml"))
    assert scene.mark == landing_marks.scene_of(name).mark
    assert make_mark_finder(scene.mark) is not None
    assert math.dist(scene.start_m, landing_marks.CENTRE_M) >= 2.0
