"""Prints of landing marks at true size, as PDF or SVG, whole or on sheets to join."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Rectangle
from matplotlib.path import Path as Outline

from perception.marks.region import RegionFinder
from perception.marks.spot import SpotFinder
from perception.marks.tag_board import black_cells_m
from perception.marks.tags import TagFinder
from sim_bridge.twin import textures
from sim_bridge.twin.objects import H_SHARE
from uav_bt.errors import FileError, InputError
from uav_bt.files import write_whole
from uav_bt.plugins import make_mark_finder
from uav_bt.types import LandingMark

Pair = tuple[float, float]  # along the mark's x and y, mm

SHEETS_MM: Final[dict[str, Pair]] = {"a4": (210.0, 297.0), "a3": (297.0, 420.0)}
_BAR_MM: Final = 100.0
_MARGIN_MM: Final = (5.0, 15.0)  # many printers need 5 mm; words and bar are above and below
_INCH_MM: Final = 25.4
# TrueType, and the same bytes for the same mark.
_STYLE: Final[Any] = {"pdf.fonttype": 42, "svg.hashsalt": "uav-bt", "font.size": 7.0}
_LINE: Final[dict[str, Any]] = {"color": "black", "linewidth": 0.5, "clip_on": False}


def print_mark(
    mark: LandingMark, name: str, path: Path, *, sheet: str | None = None
) -> tuple[int, Pair]:
    """Write the print of a mark's top to a PDF or SVG file; return the pages and their size.

    The name is printed beside it. With a sheet, `a4` or `a3`, a large mark is spread over such
    sheets; without one a mark larger than A4 gets one page of its size.
    """
    form = path.suffix.lower().removeprefix(".")
    if form not in {"pdf", "svg"}:
        raise FileError(path, "the name of a print must end in .pdf or .svg")
    if isinstance(make_mark_finder(mark), SpotFinder):
        raise InputError(f"a mark of the kind '{mark.kind}' is found without a print")
    size_mm, columns, rows = _sheets(mark, sheet)
    if form == "svg" and columns * rows > 1:
        raise FileError(path, f"SVG has one page, and this needs {columns * rows}: write a .pdf")
    parts, written = list(np.ndindex(rows, columns)), io.BytesIO()
    with mpl.rc_context(_STYLE):
        figures = [_draw(mark, name, size_mm, (rows, columns), part) for part in parts]
        if form == "svg":
            figures[0].savefig(written, format="svg", metadata={"Date": None, "Title": name})
        else:
            with PdfPages(written, metadata={"CreationDate": None, "Title": name}) as file:
                for figure in figures:
                    file.savefig(figure)
    write_whole(path, written.getvalue())
    return len(parts), size_mm


def _sheets(mark: LandingMark, sheet: str | None) -> tuple[Pair, int, int]:
    """Return the size of a page, and how many are side by side and above one another."""

    def counts(size_mm: Pair) -> list[int]:
        room = zip(mark.top_m, size_mm, _MARGIN_MM, strict=True)
        return [math.ceil(1000.0 * top / (side - 2 * rim) - 1e-9) for top, side, rim in room]

    upright = SHEETS_MM[sheet or "a4"]
    size_mm = min(upright, upright[::-1], key=lambda size: math.prod(counts(size)))
    columns, rows = counts(size_mm)
    if sheet is None and columns * rows > 1:
        wide, high = (1000.0 * side + 2 * _MARGIN_MM[1] for side in mark.top_m)
        return (max(wide, upright[0]), high), 1, 1
    return size_mm, columns, rows


def _draw(
    mark: LandingMark, name: str, size_mm: Pair, counts: tuple[int, int], part: tuple[int, int]
) -> Figure:
    """Return a page; its axes are the part of the top, in mm from the middle of the top."""
    across, up = (1000.0 * side / n for side, n in zip(mark.top_m, counts[::-1], strict=True))
    left, upper = part[1] * across - 500.0 * mark.length_m, 500.0 * mark.width_m - part[0] * up
    right, lower, (width, height) = left + across, upper - up, size_mm
    figure = Figure(figsize=(width / _INCH_MM, height / _INCH_MM))
    rim_x, rim_y = (width - across) / 2, (height - up) / 2
    axes = figure.add_axes((rim_x / width, rim_y / height, across / width, up / height))
    what = _draw_top(axes, mark)
    axes.set(xlim=(left, right), ylim=(lower, upper), aspect="auto")
    axes.axis("off")
    for x, out_x in ((left, -1.0), (right, 1.0)):
        for y, out_y in ((lower, -1.0), (upper, 1.0)):
            axes.plot((x, x), (y + out_y, y + 4.0 * out_y), **_LINE)
            axes.plot((x + out_x, x + 4.0 * out_x), (y, y), **_LINE)
    head = f"\N{UPWARDS ARROW} upper edge of {name}: {what}, {mark.length_m:g} x {mark.width_m:g} m"
    if max(counts) > 1:
        where = f"row {part[0] + 1} of {counts[0]}, column {part[1] + 1} of {counts[1]}"
        head = f"{head}; {where}: cut at the marks"
    middle, end = (left + right) / 2, lower - rim_y
    cure = "Print at 100 %: this bar is 10 cm long."
    for y, words in ((upper + rim_y - 8.5, head), (end + 9.0, cure)):
        axes.text(middle, y, words, ha="center", va="center")
    bar = (middle - _BAR_MM / 2, middle + _BAR_MM / 2)
    axes.plot(bar, (end + 5.5, end + 5.5), marker="|", **_LINE)
    return figure


def _draw_top(axes: Axes, mark: LandingMark) -> str:
    """Draw the whole top and describe it: tags as outlines, a region's border, or a picture."""
    finder = make_mark_finder(mark)
    x, y = (500.0 * side for side in mark.top_m)
    if isinstance(finder, TagFinder):
        tags = finder.board.tags
        for index in range(len(tags)):
            outline = Outline.make_compound_path_from_polys(
                1000.0 * black_cells_m(finder.board, index)
            )
            axes.add_patch(PathPatch(outline, facecolor="black", linewidth=0.0))
        one = f"tag {tags[0].id} of {tags[0].size_m:g} m"
        return f"{mark.kind}, {one if len(tags) == 1 else f'{len(tags)} tags'}"
    if isinstance(finder, RegionFinder):  # found by its class, whatever picture it has
        axes.add_patch(Rectangle((-x, -y), 2 * x, 2 * y, fill=False))
        return mark.kind
    picture = finder.picture()
    if picture is None:  # the helipad, which lies on striped paper
        picture, tile = textures.helipad_top(), textures.paper("stripes")
        columns, rows = (round(side / textures.STRIPES_M * len(tile)) for side in mark.top_m)
        stripes = np.tile(tile, (rows // len(tile) + 1, columns // len(tile) + 1, 1))
        axes.imshow(stripes[:rows, :columns], extent=(-x, x, -y, y), interpolation="none")
        x, y = H_SHARE * x, H_SHARE * y
    axes.imshow(picture, extent=(-x, x, -y, y), interpolation="none")
    return mark.kind
