"""Files of places: one place a line, or a table with a header and columns as `frame`, `x` and `y`.

Empty lines and lines that begin with `#` are passed over.
"""

from __future__ import annotations

import csv
import re
from typing import Final

from uav_bt.errors import InputError, ValueRangeError, did_you_mean
from uav_bt.types.place import NUMBER, SEPARATOR, Place

TABLE: Final = ".csv"
MAX_BYTES: Final = 200_000  # a place has some twenty
MAX_PLACES: Final = 1_000  # chosen: a battery is empty long before
_MAX_FAULTS: Final = 20  # of a file; more would only repeat the first
_COMMENT: Final = "#"
_POINT: Final = ("frame", "x", "y")
_COLUMNS: Final = (*_POINT, "height", "heading_deg", "note")
_HEADER: Final = (
    "expected a header with the column place, or with frame, x, y and perhaps height and "
    "heading_deg"
)


def read_places(data: bytes, suffix: str) -> tuple[str, list[tuple[int, str]]]:
    """Return the places of a file as a list in a tree file, and faults, each with its line.

    Args:
        data: The file's bytes.
        suffix: `.csv` for a table; any other is a text.
    """
    try:
        lines = data.decode("utf-8-sig").split("\n")
    except UnicodeDecodeError as error:
        return "", [(data.count(b"\n", 0, error.start) + 1, "expected UTF-8 text")]
    columns: list[str] = []
    places: list[str] = []
    faults: list[tuple[int, str]] = []
    for number, line in enumerate(map(str.strip, lines), 1):
        if not line or line.startswith(_COMMENT):
            continue
        try:
            if suffix == TABLE and not columns:
                columns = _header(line)
                continue
            place = _row(columns, line) if columns else line.partition(_COMMENT)[0].strip()
            Place.parse(place)
            places.append(place)
        except InputError as error:
            faults.append((number, str(error)))
        if len(places) > MAX_PLACES:
            faults.append((number, f"more than {MAX_PLACES} places"))
        headless = suffix == TABLE and not columns
        if headless or len(places) > MAX_PLACES or len(faults) >= _MAX_FAULTS:
            break
    if not places and not faults:
        faults.append((0, "the list is empty: expected at least one place"))
    return "" if faults else SEPARATOR.join(places), faults


def _cells(line: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], strict=True))]
    except csv.Error as error:
        raise ValueRangeError(f"expected cells with commas between them: {error}") from error


def _header(line: str) -> list[str]:
    """Return the names of the columns, or raise a ValueRangeError."""
    for sign, name in ((";", "';'"), ("\t", "tabs")):
        if sign in line and "," not in line:
            raise ValueRangeError(f"expected commas between the cells, got {name}")
    cells = _cells(line)
    known = ("place", "note") if "place" in cells else _COLUMNS
    for name in cells:
        if name not in known or cells.count(name) > 1:
            raise ValueRangeError(f"{_HEADER}, got the column '{name}'{did_you_mean(name, known)}")
    missing = [name for name in _POINT if name not in cells and "place" not in cells]
    if missing:
        raise ValueRangeError(f"{_HEADER}; the column '{missing[0]}' is missing")
    return cells


def _row(columns: list[str], line: str) -> str:
    """Return the place of a line, or raise a ValueRangeError."""
    cells = _cells(line)
    if len(cells) != len(columns):
        raise ValueRangeError(
            f"expected {len(columns)} cells ({', '.join(columns)}), got {len(cells)}: a place with "
            "commas stands in quotes"
        )
    row = {**dict.fromkeys(_COLUMNS, ""), **dict(zip(columns, cells, strict=True))}
    if "place" in row:
        return row["place"]
    frame, x, y, height, heading, _ = (row[name] for name in _COLUMNS)
    is_named = frame == "mark" or frame.startswith("object:")
    if is_named and (x or y or height):
        raise ValueRangeError(f"expected no x, y and height of '{frame}': leave the cells empty")
    for name in _COLUMNS[1:-1]:
        needed = name in _POINT and not is_named
        if (needed or row[name]) and not re.fullmatch(NUMBER, row[name]):
            raise ValueRangeError(f"column '{name}': expected a number, got '{row[name]}'")
    point = "" if is_named else f":{x},{y}{height and f',{height}'}"
    return f"{frame}{point}{heading and f'@{heading}'}"
