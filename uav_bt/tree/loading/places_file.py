"""Files of places: a text with one place a line, or a table.

A text (`.txt`) has a place a line, as tree files write them. A table (`.csv`) has a header, and
either a column `place` or the columns `frame`, `x` and `y`, and perhaps `height` and `heading_deg`.
The column `note` is free. Empty lines and lines that begin with `#` are passed over.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from uav_bt.errors import InputError, ValueRangeError, did_you_mean
from uav_bt.types.place import NUMBER, SEPARATOR, Place, PlaceFrame

TABLE: Final = ".csv"
MAX_BYTES: Final = 200_000  # a place has some twenty
MAX_PLACES: Final = 1_000  # chosen: a battery is empty long before
_MAX_FAULTS: Final = 20  # of a file; more would only repeat the first
_COMMENT: Final = "#"
_PLACE: Final = "place"
_FRAME: Final = "frame"
_NOTE: Final = "note"
_POINT: Final = ("x", "y")
_NUMBERS: Final = (*_POINT, "height", "heading_deg")
_HEADER: Final = (
    "expected a header with the column place, or with frame, x, y and perhaps height and "
    "heading_deg"
)
_OBJECT: Final = re.compile(r"object:\d+")


@dataclass(frozen=True)
class PlacesRead:
    """The content of a file of places.

    Attributes:
        text: The places as a tree file writes a list; empty with faults.
        faults: Each with the number of its line, 0 for the whole file.
    """

    text: str
    faults: tuple[tuple[int, str], ...] = ()


def read_places(data: bytes, suffix: str) -> PlacesRead:
    """Read a file of places.

    Args:
        data: The file's bytes.
        suffix: `.csv` for a table; any other is a text.
    """
    try:
        lines = data.removeprefix(codecs.BOM_UTF8).decode().split("\n")
    except UnicodeDecodeError as error:
        return PlacesRead("", ((data.count(b"\n", 0, error.start) + 1, "expected UTF-8 text"),))
    rows = [(number, line.strip()) for number, line in enumerate(lines, 1)]
    rows = [(number, line) for number, line in rows if line and not line.startswith(_COMMENT)]
    places: list[str] = []
    faults: list[tuple[int, str]] = []
    for number, found in _table(rows) if suffix == TABLE else _text(rows):
        if isinstance(found, InputError):
            faults.append((number, str(found)))
        else:
            places.append(found)
        if len(places) > MAX_PLACES:
            faults.append((number, f"more than {MAX_PLACES} places"))
        if len(places) > MAX_PLACES or len(faults) >= _MAX_FAULTS:
            break
    if not places and not faults:
        faults.append((0, "the list is empty: expected at least one place"))
    return PlacesRead("" if faults else SEPARATOR.join(places), tuple(faults))


def _text(rows: Sequence[tuple[int, str]]) -> Iterator[tuple[int, str | InputError]]:
    """Yield each place of a text, or its fault, with the line's number."""
    for number, line in rows:
        bare = line.partition(_COMMENT)[0].strip()
        try:
            Place.parse(bare)
            yield number, bare
        except InputError as error:
            yield number, error


def _table(rows: Sequence[tuple[int, str]]) -> Iterator[tuple[int, str | InputError]]:
    """Yield each place of a table, or its fault, with the line's number."""
    columns: list[str] = []
    for number, line in rows:
        try:
            cells = _cells(line)
            if not columns:
                columns = _checked_header(cells)
                continue
            if len(cells) != len(columns):
                raise ValueRangeError(
                    f"expected {len(columns)} cells ({', '.join(columns)}), got {len(cells)}: a "
                    "place with commas stands in quotes"
                )
            place = _place(dict(zip(columns, cells, strict=True)))
            Place.parse(place)
            yield number, place
        except InputError as error:
            yield number, error
            if not columns:
                return


def _cells(line: str) -> list[str]:
    """Return the cells of a line.

    Raises:
        ValueRangeError: A quotation mark has no counterpart.
    """
    try:
        return [cell.strip() for row in csv.reader([line], strict=True) for cell in row]
    except csv.Error as error:
        raise ValueRangeError(f"expected cells with commas between them: {error}") from error


def _checked_header(cells: list[str]) -> list[str]:
    """Return the names of the columns.

    Raises:
        ValueRangeError: One is missing, unknown or stands there twice.
    """
    known = (_PLACE, _NOTE) if _PLACE in cells else (_FRAME, *_NUMBERS, _NOTE)
    for name in cells:
        if name not in known or cells.count(name) > 1:
            raise ValueRangeError(f"{_HEADER}, got the column '{name}'{did_you_mean(name, known)}")
    needed = () if _PLACE in cells else (_FRAME, *_POINT)
    missing = [name for name in needed if name not in cells]
    if missing:
        raise ValueRangeError(f"{_HEADER}; the column '{missing[0]}' is missing")
    return cells


def _place(row: dict[str, str]) -> str:
    """Return the place of a row, as a tree file writes it.

    Raises:
        ValueRangeError: A cell has another content than its column.
    """
    if _PLACE in row:
        return row[_PLACE]
    frame = row[_FRAME]
    frames = [one.value for one in PlaceFrame]
    is_named = frame == PlaceFrame.MARK.value or _OBJECT.fullmatch(frame) is not None
    if not is_named and (frame not in frames or frame == PlaceFrame.OBJECT.value):
        raise ValueRangeError(
            "column 'frame': expected start, body, lab, mark or an object such as object:3, got "
            f"'{frame}'{did_you_mean(frame, frames)}"
        )
    for name in _NUMBERS:
        _check_number(name, row.get(name, ""), needed=name in _POINT and not is_named)
    place = frame
    if not is_named:
        place += ":" + ",".join(filter(None, (row["x"], row["y"], row.get("height"))))
    elif any(row.get(name) for name in ("x", "y", "height")):
        raise ValueRangeError(f"expected no x, y and height of '{frame}': leave the cells empty")
    heading = row.get("heading_deg")
    return f"{place}@{heading}" if heading else place


def _check_number(column: str, text: str, *, needed: bool) -> None:
    if (needed or text) and not re.fullmatch(NUMBER, text):
        raise ValueRangeError(f"column '{column}': expected a number, got '{text}'")
