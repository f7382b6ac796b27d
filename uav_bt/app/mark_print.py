"""Prints of landing marks at true size, as PDF or SVG, whole or on sheets to join."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

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
from uav_bt.files import whole_file
from uav_bt.plugins import make_mark_finder
from uav_bt.types import LandingMark
from uav_bt.types.arrays import Image

SHEETS_MM: Final = {"a4": (210.0, 297.0), "a3": (297.0, 420.0)}
BAR_MM: Final = 100.0
_SIDE_MM: Final = 5.0  # of a sheet left and right, where many printers do not print
_END_MM: Final = 15.0  # above and below, for the words and the bar
_INCH_MM: Final = 25.4
_LINE_PT: Final = 0.5
# Text as text in TrueType, and the same bytes for the same mark.
_STYLE: Final[Any] = {"pdf.fonttype": 42, "svg.hashsalt": "uav-bt", "font.size": 7.0}


class Page(NamedTuple):
    """A page, and the part of the mark's top that it shows, mm from the top's middle."""

    size_mm: tuple[float, float]
    left_mm: float
    lower_mm: float
    shown_mm: tuple[float, float]
    note: str = ""


def print_mark(mark: LandingMark, name: str, path: Path, *, sheet: str | None = None) -> list[Page]:
    """Write the print of a landing mark's top at true size.

    Args:
        mark: The mark.
        name: Printed beside it.
        path: A PDF or SVG file, by its suffix.
        sheet: `a4` or `a3` to spread a large mark over such sheets; None: a mark larger than A4
            gets one page of its size.

    Returns:
        The pages.

    Raises:
        InputError: The kind of mark has no print, or the file has another suffix or more than one
            page in SVG.
    """
    form = path.suffix.lower().removeprefix(".")
    if form not in {"pdf", "svg"}:
        raise FileError(path, "the name of a print must end in .pdf or .svg")
    finder = make_mark_finder(mark)
    if isinstance(finder, SpotFinder):
        raise InputError(f"a mark of the kind '{mark.kind}' is found without a print")
    pages = _pages(mark, sheet)
    if form == "svg" and len(pages) > 1:
        raise FileError(path, f"SVG has one page, and the mark needs {len(pages)}: write a .pdf")
    words = f"{name}: {_described(mark, finder)}"
    with mpl.rc_context(_STYLE), whole_file(path) as partial:
        figures = (_draw(page, mark, finder, words) for page in pages)
        if form == "svg":
            next(figures).savefig(partial, format="svg", metadata={"Date": None, "Title": name})
        else:
            with PdfPages(partial, metadata={"CreationDate": None, "Title": name}) as file:
                for figure in figures:
                    file.savefig(figure)
    return pages


def _pages(mark: LandingMark, sheet: str | None) -> list[Page]:
    """Return the page of a mark, or the sheets with its parts from the upper left."""
    top_mm = 1000.0 * mark.length_m, 1000.0 * mark.width_m
    upright = SHEETS_MM[sheet or "a4"]
    size_mm = min(upright, upright[::-1], key=lambda size_mm: math.prod(_counts(top_mm, size_mm)))
    columns, rows = _counts(top_mm, size_mm)
    if sheet is None and columns * rows > 1:
        columns = rows = 1
        size_mm = max(top_mm[0] + 2 * _END_MM, upright[0]), top_mm[1] + 2 * _END_MM
    shown_mm = top_mm[0] / columns, top_mm[1] / rows
    pages = []
    for row, column in np.ndindex(rows, columns):
        left_mm = column * shown_mm[0] - top_mm[0] / 2
        lower_mm = top_mm[1] / 2 - (row + 1) * shown_mm[1]
        note = f"row {row + 1} of {rows}, column {column + 1} of {columns}"
        note = note if rows * columns > 1 else ""
        pages.append(Page(size_mm, left_mm, lower_mm, shown_mm, note))
    return pages


def _counts(top_mm: Sequence[float], size_mm: Sequence[float]) -> tuple[int, int]:
    """Return the columns and rows of sheets that a mark needs."""
    margins_mm = _SIDE_MM, _END_MM
    columns, rows = (
        math.ceil(top / (side - 2 * margin) - 1e-9)
        for top, side, margin in zip(top_mm, size_mm, margins_mm, strict=True)
    )
    return columns, rows


def _described(mark: LandingMark, finder: object) -> str:
    tags = finder.board.tags if isinstance(finder, TagFinder) else ()
    what = [" ".join([mark.kind, *filter(None, [mark.options.get("family")])])]
    if tags:
        what.append(f"tag {tags[0].id} of {tags[0].size_m:g} m")
    if len(tags) > 1:
        what[-1] = f"{len(tags)} tags"
    return ", ".join([*what, f"top {mark.length_m:g} x {mark.width_m:g} m"])


def _draw(page: Page, mark: LandingMark, finder: Any, words: str) -> Figure:
    """Return a page whose axes are millimetres from the middle of the mark's top."""
    (width_mm, height_mm), (shown_x, shown_y) = page.size_mm, page.shown_mm
    figure = Figure(figsize=(width_mm / _INCH_MM, height_mm / _INCH_MM))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.axis("off")
    left = page.left_mm + (shown_x - width_mm) / 2
    low = page.lower_mm + (shown_y - height_mm) / 2
    shown = Rectangle((page.left_mm, page.lower_mm), shown_x, shown_y, transform=axes.transData)
    for artist in _draw_top(axes, mark, finder):
        artist.set_clip_path(shown)
    axes.set(xlim=(left, left + width_mm), ylim=(low, low + height_mm), aspect="auto")
    for x, out_x in ((page.left_mm, -1.0), (page.left_mm + shown_x, 1.0)):
        for y, out_y in ((page.lower_mm, -1.0), (page.lower_mm + shown_y, 1.0)):
            _line(axes, (x, x), (y + out_y, y + 4.0 * out_y))
            _line(axes, (x + out_x, x + 4.0 * out_x), (y, y))
    middle, upper = left + width_mm / 2, low + height_mm
    note = f"; {page.note}: cut at the marks" if page.note else ""
    head = f"\N{UPWARDS ARROW} upper edge of {words}{note}"
    axes.text(middle, upper - 8.5, head, ha="center", va="center")
    cure = "Print at 100 %: this bar is 10 cm long."
    axes.text(middle, low + 8.5, cure, ha="center", va="center")
    begin = middle - BAR_MM / 2
    _line(axes, (begin, begin + BAR_MM), (low + 5.5, low + 5.5))
    for x in (begin, begin + BAR_MM):
        _line(axes, (x, x), (low + 4.5, low + 6.5))
    return figure


def _line(axes: Axes, x_mm: Sequence[float], y_mm: Sequence[float]) -> None:
    axes.plot(x_mm, y_mm, color="black", linewidth=_LINE_PT, solid_capstyle="butt")


def _draw_top(axes: Axes, mark: LandingMark, finder: Any) -> Iterator[Any]:
    """Draw the top of a mark: tags as outlines, a region's border, or a picture."""
    half_x, half_y = 500.0 * mark.length_m, 500.0 * mark.width_m
    if isinstance(finder, TagFinder):
        for index in range(len(finder.board.tags)):
            cells_mm = 1000.0 * black_cells_m(finder.board, index)
            outline = Outline.make_compound_path_from_polys(cells_mm)
            yield axes.add_patch(PathPatch(outline, facecolor="black", linewidth=0.0))
        return
    if isinstance(finder, RegionFinder):  # found by its class, whatever picture it has
        border = Rectangle((-half_x, -half_y), 2 * half_x, 2 * half_y, fill=False)
        border.set_linewidth(_LINE_PT)
        yield axes.add_patch(border)
        return
    picture = finder.picture()
    if picture is None:  # the helipad
        yield _show(axes, _stripes(mark), half_x, half_y)
        picture, half_x, half_y = textures.helipad_top(), H_SHARE * half_x, H_SHARE * half_y
    yield _show(axes, picture, half_x, half_y)


def _show(axes: Axes, picture: Image, half_x: float, half_y: float) -> Any:
    extent = (-half_x, half_x, -half_y, half_y)
    return axes.imshow(picture, extent=extent, interpolation="none")


def _stripes(mark: LandingMark) -> Image:
    """Return the striped paper around the H, as large as the mark's top."""
    tile = textures.paper("stripes")
    columns, rows = (round(side / textures.STRIPES_M * len(tile)) for side in mark.top_m)
    repeated = np.tile(tile, (rows // len(tile) + 1, columns // len(tile) + 1, 1))
    return np.asarray(repeated[:rows, :columns])
