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
from uav_bt.lab.shipped import load_lab
from uav_bt.landing_marks import MarkView
from uav_bt.plugins import make_mark_finder
from uav_bt.types.arrays import Image

POINT_M: Final = 0.0254 / 72.0
PX_PER_M: Final = 4000.0
CORNERS: Final = ([-0.2, 0.15], [0.2, 0.15], [0.2, -0.15])


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def write_mark(**keys: Any) -> None:
    lab_folder(Path("labs/hall"), f"{HALL}mark: { ({'height_m': 0} | keys) }\n")


def drawn(svg: Path) -> Image:
    """Return an SVG file as an image: its filled outlines without curves."""
    text = svg.read_text(encoding="utf-8")
    sides = re.findall(r' (?:width|height)="([\d.]+)pt"', text)
    width, height = (round(float(side) * POINT_M * PX_PER_M) for side in sides)
    image = np.full((height, width, 3), 255, np.uint8)
    for path in re.findall(r'<path d="(M[^"]*)" clip-path="[^"]*"/>', text):
        for part in path.split("z")[:-1]:
            points = np.array(re.findall(r"[ML] ([-\d.]+) ([-\d.]+)", part), float)
            corners = np.rint(points * POINT_M * PX_PER_M * 16 - 8).astype(np.int32)
            cv2.fillPoly(image, [corners], (0, 0, 0), shift=4)
    return image


@pytest.mark.parametrize(
    ("kind", "top_m", "more", "tags"),
    [
        ("apriltag", [0.19, 0.25], {}, [(7, 0.15, [0.0, 0.0])]),
        ("apriltag", [0.19, 0.25], {"print": "opencv"}, [(7, 0.15, [0.0, 0.0])]),
        ("apriltag", [0.25, 0.19], {"family": "16h5"}, [(7, 0.12, [0.02, -0.01])]),
        ("aruco", [0.19, 0.19], {}, [(7, 0.12, [0.0, 0.0])]),
        ("aruco", [0.6, 0.5], {}, [(n, 0.12, at) for n, at in enumerate(CORNERS)]),
    ],
)
def test_a_print_has_its_size_and_is_found_with_its_heading(
    kind: str, top_m: list[float], more: dict[str, str], tags: list[Any]
) -> None:
    listed = [dict(zip(("id", "size_m", "at_m"), tag, strict=True)) for tag in tags]
    write_mark(kind=kind, size_m=top_m, options={"tags": listed, **more})
    assert run("lab", "print-mark", "hall", "--out", "mark.svg").exit_code == 0
    page, mark = drawn(Path("mark.svg")), load_lab("hall").mark
    spans = np.ptp([at for _, _, at in tags], axis=0)[::-1] + tags[0][1]
    black = np.argwhere(page[..., 0] == 0)
    assert (np.ptp(black, axis=0) + 1) / PX_PER_M == pytest.approx(spans, rel=0.005)
    rows, columns = (round(side * PX_PER_M) for side in top_m[::-1])
    above, beside = (page.shape[0] - rows) // 2, (page.shape[1] - columns) // 2
    top = page[above : above + rows, beside : beside + columns]
    frame = view_of(top, mark, forward_m=0.6, heading_deg=35.0, camera_m=0.9, pitch_deg=-60.0)
    seen = make_mark_finder(mark).find(MarkView(frame=frame, camera=TAG_CAMERA))
    assert seen.heading_deg == pytest.approx(35.0, abs=1.5)


@pytest.mark.parametrize(
    ("kind", "top_m", "sheet", "pages", "size_mm"),
    [
        ("region", [0.2, 0.26], None, 1, (210, 297)),
        ("region", [0.26, 0.17], None, 1, (297, 210)),
        ("helipad", [0.5, 0.4], None, 1, (530, 430)),
        ("helipad", [0.5, 0.25], "a4", 3, (210, 297)),
        ("helipad", [0.38, 0.5], "a3", 2, (420, 297)),
    ],
)
def test_pages_are_sheets_or_as_large_as_the_mark(
    kind: str, top_m: list[float], sheet: str | None, pages: int, size_mm: tuple[int, int]
) -> None:
    write_mark(kind=kind, size_m=top_m)
    call = ("lab", "print-mark", "hall", *(("--sheet", sheet) if sheet else ()))
    assert run(*call).stdout.startswith(f"written: hall-mark.pdf; pages: {pages} of")
    written = Path("hall-mark.pdf").read_bytes()
    boxes = re.findall(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", written)
    assert np.array(boxes, float) * POINT_M * 1000 == pytest.approx(np.tile(size_mm, (pages, 1)))
    if pages > 1:
        assert_refused(run(*call, "--out", "mark.svg"), "SVG has one page")


def test_a_lab_without_a_mark_that_can_be_printed_is_refused() -> None:
    write_mark(kind="spot", size_m=[0.5, 0.5])
    assert_refused(run("lab", "print-mark", "hall"), "is found without a print")
    lab_folder(Path("labs/hall"), HALL)
    assert_refused(run("lab", "print-mark", "hall"), "states no landing mark")
