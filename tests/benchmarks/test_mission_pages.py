"""Generated parts of the pages of missions: those in the pages are those of today's trees."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from benchmarks.mission_pages import IMAGES, NAMES, ROOT, drawing_files, flight_part, with_part

FLOWN = {"scene": "val-a", "seed": 7, "outcome": "success", "reason": "landed", "profile": "harsh"}
FOUND = {"objects_found": 6, "objects_total": 8, "false_objects": 1, "photos": [{}, {}]}
FIGURES = {"min_clearance_m": 0.318, "landing_error_m": 0.0414, "total_distance_m": 7.77}
REPORT: dict[str, Any] = {**FLOWN, **FOUND, **FIGURES, "duration_s": 61.23}


@pytest.mark.parametrize("name", NAMES)
def test_a_page_has_todays_drawings_a_film_and_a_row_in_the_index(name: str) -> None:
    for file, text in drawing_files(name).items():
        remedy = "run: python -m benchmarks.mission_pages --drawings"
        assert file.read_text(encoding="utf-8") == text, remedy
    assert (IMAGES / f"{name}.webp").stat().st_size <= 600_000
    index = (ROOT / "docs" / "missions.md").read_text(encoding="utf-8")
    assert f"| [{name}](missions/{name}.md) |" in index


def test_a_drawing_has_the_trees_of_the_mission_and_no_inside_of_shared_ones() -> None:
    files = drawing_files("find_and_hover")
    page, whole = (
        next(text for file, text in files.items() if file.suffix == suffix)
        for suffix in (".md", ".svg")
    )
    assert "ViewPoints of={object}" in page  # inside the mission's own FindAndHover
    assert "SubTree ComeHome" in page
    assert "ReturnToBase" not in page  # inside ComeHome
    assert "ReturnToBase" in whole


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


@pytest.mark.parametrize("text", ["", "<!-- flight -->\n", "<!-- end -->\n<!-- flight -->\n"])
def test_a_page_without_the_part_is_refused(text: str, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(text)
    with pytest.raises(SystemExit, match="expected a line `<!-- flight -->`"):
        with_part(page, "flight", "new\n")
