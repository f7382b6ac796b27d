"""Generated parts of the pages of missions: those in the pages are those of today's trees."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from benchmarks import mission_pages
from benchmarks.animation import film_seconds, images_of, write_animation_within
from benchmarks.page_parts import (
    IMAGES,
    ROOT,
    Origin,
    drawing_files,
    flight,
    page_names,
    with_part,
)
from uav_bt.errors import FileError

ORIGIN = Origin(command="uav-bt fly M --seed 7", commit="1234567", day="1 May 2026")


def report(**changed: Any) -> dict[str, Any]:
    made = {
        "scene": "val-a",
        "seed": 7,
        "outcome": "success",
        "reason": "landed",
        "profile": "harsh",
        "duration_s": 61.23,
        "total_distance_m": 7.77,
        "photos": [{}, {}],
        "objects_found": 6,
        "objects_total": 8,
        "false_objects": 1,
        "min_clearance_m": 0.318,
        "landing_error_m": 0.0414,
    }
    return {**made, **changed}


@pytest.mark.parametrize("name", page_names())
def test_the_drawings_are_those_of_the_trees(name: str) -> None:
    for file, text in drawing_files(name).items():
        assert file.read_text(encoding="utf-8") == text, (
            "run: python -m benchmarks.mission_pages --drawings"
        )


@pytest.mark.parametrize("name", page_names())
def test_a_page_has_a_film_and_a_row_in_the_index(name: str) -> None:
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


def test_the_part_of_a_flight_has_figures_and_origin() -> None:
    part = flight(report(), ORIGIN, "patrol_and_photograph", 4.26)
    assert (
        "| `val-a`, 7 | success: landed | 61.2 s | 7.8 m | 2 | 6 of 8, 1 false | 0.32 m | 0.041 m |"
    ) in part
    assert "4.3 times as fast" in part
    assert "Commit `1234567`, 1 May 2026, one flight in the twin, profile `harsh`:" in part
    assert "`uav-bt fly M --seed 7`" in part


def test_a_mission_that_lands_beside_the_mark_has_no_landing_error() -> None:
    part = flight(report(photos=[]), ORIGIN, "land_elsewhere", 1.0)
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
    with pytest.raises(FileError, match=r"expected one line `<!-- flight -->`"):
        with_part(page, "flight", "new\n")


def test_a_film_is_cut_at_equal_steps_of_time(tmp_path: Path) -> None:
    film = tmp_path / "film.mp4"
    with av.open(str(film), "w") as container:
        stream = container.add_stream("mpeg4", rate=10)
        stream.width, stream.height, stream.pix_fmt = 64, 32, "yuv420p"
        for grey in range(0, 200, 10):
            image = np.full((32, 64, 3), grey, dtype=np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="bgr24")))
        container.mux(stream.encode())
    assert film_seconds(film) == pytest.approx(2.0, abs=0.01)
    images = images_of(film, 0.5, 32, lambda image: image[:16])
    assert [image.shape for image in images] == [(8, 32, 3)] * 4
    assert [float(image.mean()) for image in images] == pytest.approx([0, 50, 100, 150], abs=6)


def test_an_animation_that_is_too_large_is_refused(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (4, 64, 64, 3), dtype=np.uint8)
    write_animation_within(list(noise), 100, tmp_path / "large.webp", 100_000)
    with pytest.raises(ValueError, match="larger than 500 bytes"):
        write_animation_within(list(noise), 100, tmp_path / "small.webp", 500)


@pytest.fixture
def runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty folder in place of `runs/missions`."""
    monkeypatch.setattr(mission_pages, "RUNS", tmp_path / "runs")
    return tmp_path / "runs"


@pytest.mark.parametrize("code", [0, 1])
def test_a_flight_keeps_its_origin_if_it_succeeded(
    code: int, runs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown: list[list[str]] = []

    def run(words: list[str], **_: Any) -> subprocess.CompletedProcess[str]:
        flown.append(words[3:])
        return subprocess.CompletedProcess(words, code)

    monkeypatch.setattr(mission_pages, "commit", lambda _: "0123456789abcdef+changes")
    monkeypatch.setattr(mission_pages.subprocess, "run", run)
    if code:
        with pytest.raises(SystemExit, match="1"):
            mission_pages.fly("inventory")
        assert list(runs.iterdir()) == []
        return
    mission_pages.fly("inventory")
    origin = Origin(**json.loads((runs / "inventory.origin.json").read_text()))
    assert origin.commit == "0123456+changes"
    assert re.fullmatch(r"\d{1,2} [A-Z][a-z]+ \d{4}", origin.day)
    assert origin.command.split() == ["uav-bt", *flown[0]]
    assert flown[0][:2] == ["fly", "inventory"]


def test_a_film_without_a_flight_is_refused(runs: Path) -> None:
    with pytest.raises(FileError, match="fly the mission first"):
        mission_pages.write_flight("inventory")
