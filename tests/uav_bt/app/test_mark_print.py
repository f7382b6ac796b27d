"""Prints of landing marks: size, heading, pages."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
import pytest

from tests.perception.marks.mark_views import TAG_CAMERA, view_of
from tests.worlds.cli import assert_refused, run
from tests.worlds.labs import HALL, lab_folder
from uav_bt.landing_marks import MarkView
from uav_bt.plugins import make_mark_finder
from uav_bt.types import LandingMark
from uav_bt.types.arrays import Image

POINT_M: Final = 0.0254 / 72.0
PX_PER_M: Final = 4000.0
TAG: Final = {"id": 7, "size_m": 0.15}
CORNERS: Final = [(-0.2, 0.15), (0.2, 0.15), (0.2, -0.15)]
BOARD: Final = {"tags": [{"id": n, "size_m": 0.12, "at_m": at} for n, at in enumerate(CORNERS)]}
PRINTED: Final[dict[str, tuple[str, tuple[float, float], dict[str, Any]]]] = {
    "an AprilTag": ("apriltag", (0.19, 0.25), TAG),
    "as OpenCV": ("apriltag", (0.19, 0.25), {**TAG, "print": "opencv"}),
    "another family": ("apriltag", (0.25, 0.19), {**TAG, "family": "16h5", "size_m": 0.12}),
    "ArUco": ("aruco", (0.19, 0.19), {**TAG, "size_m": 0.12}),
    "a board": ("aruco", (0.6, 0.5), BOARD),
}


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def printed(kind: str, top_m: tuple[float, float], options: Any, *words: object) -> LandingMark:
    """Print the mark of a lab `hall` in the working directory."""
    mark = LandingMark(
        kind=kind, length_m=top_m[0], width_m=top_m[1], height_m=0.0, options=options
    )
    text = f"{HALL}mark: {{kind: {kind}, size_m: {[*top_m]}, height_m: 0, options: {options}}}\n"
    lab_folder(Path("labs/hall"), text.replace("(", "[").replace(")", "]"))
    result = run("lab", "print-mark", "hall", *words)
    assert result.exit_code == 0, result.output
    return mark


def drawn(svg: Path) -> Image:
    """Return an SVG file as an image: its filled outlines without curves."""
    text = svg.read_text(encoding="utf-8")
    sides = re.search(r'<svg[^>]* width="([\d.]+)pt" height="([\d.]+)pt"', text)
    assert sides is not None
    width, height = (round(float(side) * POINT_M * PX_PER_M) for side in sides.groups())
    image = np.full((height, width, 3), 255, np.uint8)
    for path in re.findall(r'<path d="(M[^"]*)" clip-path="[^"]*"/>', text):
        for part in path.split("z")[:-1]:
            points = np.array(re.findall(r"[ML] ([-\d.]+) ([-\d.]+)", part), float)
            corners = np.rint(points * POINT_M * PX_PER_M * 16 - 8).astype(np.int32)
            cv2.fillPoly(image, [corners], (0, 0, 0), shift=4)
    return image


@pytest.mark.parametrize("what", PRINTED)
def test_a_print_has_its_size_and_is_found_with_its_heading(what: str) -> None:
    mark = printed(*PRINTED[what], "--out", "mark.svg")
    page = drawn(Path("mark.svg"))
    black = np.argwhere(page[..., 0] == 0)
    tags = [{"at_m": (0.0, 0.0), **tag} for tag in mark.options.get("tags", [mark.options])]
    edges = [(np.array(tag["at_m"]) + sign * tag["size_m"] / 2) for tag in tags for sign in (-1, 1)]
    across, up = np.ptp(edges, axis=0)
    assert (np.ptp(black, axis=0) + 1) / PX_PER_M == pytest.approx([up, across], rel=0.005)
    rows, columns = (round(side * PX_PER_M) for side in mark.top_m[::-1])
    above, beside = (page.shape[0] - rows) // 2, (page.shape[1] - columns) // 2
    top = page[above : above + rows, beside : beside + columns]
    frame = view_of(top, mark, forward_m=0.6, heading_deg=35.0, camera_m=0.9, pitch_deg=-60.0)
    seen = make_mark_finder(mark).find(MarkView(frame=frame, camera=TAG_CAMERA))
    assert seen is not None
    assert seen.heading_deg == pytest.approx(35.0, abs=1.5)


@pytest.mark.parametrize(
    ("kind", "top_m", "sheet", "pages", "size_mm"),
    [
        ("region", (0.2, 0.26), "", 1, (210, 297)),
        ("region", (0.26, 0.17), "", 1, (297, 210)),
        ("helipad", (0.5, 0.4), "", 1, (530, 430)),
        ("helipad", (0.5, 0.25), "a4", 3, (210, 297)),
        ("helipad", (0.38, 0.5), "a3", 2, (420, 297)),
    ],
)
def test_pages_are_sheets_or_as_large_as_the_mark(
    kind: str, top_m: tuple[float, float], sheet: str, pages: int, size_mm: tuple[int, int]
) -> None:
    words = ("--sheet", sheet) if sheet else ()
    printed(kind, top_m, {}, *words)
    boxes = re.findall(
        rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", Path("hall-mark.pdf").read_bytes()
    )
    assert len(boxes) == pages
    assert np.array(boxes, float) * POINT_M * 1000 == pytest.approx(np.tile(size_mm, (pages, 1)))


def test_what_cannot_be_printed_is_refused() -> None:
    for mark, words in (("spot", "is found without a print"), ("", "states no landing mark")):
        text = f"mark: {{kind: {mark}, size_m: [0.5, 0.5], height_m: 0}}\n" if mark else ""
        lab_folder(Path("labs/hall"), f"{HALL}{text}")
        assert_refused(run("lab", "print-mark", "hall"), words)
    lab_folder(Path("labs/hall"), f"{HALL}mark: {{size_m: [0.5, 0.5], height_m: 0}}\n")
    svg = run("lab", "print-mark", "hall", "--sheet", "a4", "--out", "mark.svg")
    assert_refused(svg, "SVG has one page")
    assert [*Path().glob("*.*")] == []
