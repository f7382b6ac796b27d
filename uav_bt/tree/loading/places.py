"""Lists of places from files: `file:rounds.csv` in a tree file becomes the places of that file.

A file has one place a line, or is a table with a header and columns as `frame`, `x` and `y`. Empty
lines and lines that begin with `#` are passed over. Its text is kept with those of the tree files,
so that checksums, records and replays have it.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Final

from uav_bt.errors import FileError, InputError, ValueRangeError, did_you_mean
from uav_bt.files import read_bounded
from uav_bt.tree.loading.elements import node_attributes, node_id_of
from uav_bt.tree.loading.findings import WHOLE_FILE, Findings, Position, Rule
from uav_bt.tree.loading.lookup import file_in
from uav_bt.tree.loading.parameters import VAR, Parameters
from uav_bt.tree.loading.source import Element
from uav_bt.tree.mission_tree import Place as At
from uav_bt.tree.node import NodeKind
from uav_bt.tree.port import CONDITION_ATTRIBUTES
from uav_bt.tree.registry import NodeRegistry
from uav_bt.types.place import FILE_PREFIX, FILE_SUFFIXES, NUMBER, SEPARATOR, Place

MAX_FILES: Final = 50  # of a mission, as of included files
MAX_BYTES: Final = 200_000  # of a file; a place has some twenty
MAX_PLACES: Final = 1_000  # of a file; chosen: a battery is empty long before
# Stands for the places of a file with faults, so that no port adds a second finding. An area has
# three corners.
_STAND_IN: Final = "start:-1,-1;start:2,-1;start:-1,2"
_NAMED: Final = re.compile(
    rf"\s*{FILE_PREFIX}\s*(?P<name>[^;{{}}]*(?:{'|'.join(map(re.escape, FILE_SUFFIXES))}))\s*",
    re.IGNORECASE,
)
_COMMENT: Final = "#"
_POINT: Final = ("frame", "x", "y")
_COLUMNS: Final = (*_POINT, "height", "heading_deg", "note")
_HEADER: Final = (
    "expected a header with the column place, or with frame, x, y and perhaps height and "
    "heading_deg"
)


class PlaceLists:
    """Replaces files of places by their content; each is read once."""

    def __init__(self, sources: dict[Path, bytes], findings: Findings) -> None:
        self._sources = sources  # takes the texts of the files
        self._findings = findings
        self._texts: dict[Path, str] = {}

    def in_attributes(self, element: Element, registry: NodeRegistry) -> dict[str, str]:
        """Return the attributes of a node that change with the places of the files they name."""
        return {
            name: self.in_attribute(element, name)
            for name, text in node_attributes(element).items()
            if FILE_PREFIX in text and takes_places(element, name, registry)
        }

    def in_parameters(self, parameters: Parameters, home: Path) -> Parameters:
        """Return parameters whose variables have the places of files beside a tree file."""
        variables = dict(parameters.variables)
        for name, value in parameters.variables.items():
            if isinstance(value, str):
                at = parameters.places.get((VAR, name), At(home, Position(1, 1)))
                variables[name] = self.in_text(value, home, at, f"variable '{name}'")
        return replace(parameters, variables=variables)

    def in_attribute(self, element: Element, name: str) -> str:
        """Return the text of an attribute with the places of files."""
        at, text = At(element.path, element.at(name)), element.attributes.get(name, "")
        return self.in_text(text, element.path, at, f"attribute '{name}'", element.label)

    def in_text(self, text: str, home: Path, at: At, what: str, node: str = "") -> str:
        """Return a list with the places of the files beside `home`; messages name what and node."""
        parts = text.split(SEPARATOR)
        for index, named in enumerate(map(_NAMED.fullmatch, parts)):
            if named is not None:
                try:
                    parts[index] = self._places(named["name"].strip(), home, at, what, node)
                except InputError as error:
                    message = f"{what}: {error}"
                    self._findings.add(at.path, at.position, message, node, rule=Rule.PLACES)
                    parts[index] = _STAND_IN
        return SEPARATOR.join(parts)

    def _places(self, name: str, home: Path, at: At, what: str, node: str) -> str:
        """Return the places of a file and note its faults, or raise an InputError."""
        if not home.is_file():
            message = "only a tree that is loaded from a file can name one of places"
            raise InputError(f"'{name}': {message}")
        folder, pure = home.resolve().parent, PurePosixPath(name)
        below = () if pure.is_absolute() or ".." in pure.parts else (folder,)
        cure = "expected a file of places beside the tree file or below"
        target = file_in(folder, name, below, f"{folder}: {cure}")
        if target in self._texts:
            return self._texts[target]
        if len(self._texts) >= MAX_FILES:
            raise InputError(f"more than {MAX_FILES} files of places are named")
        data = self._sources[target] = read_bounded(target, MAX_BYTES, FileError)
        places, faults = read_places(data, is_table=target.suffix.lower() == ".csv")
        who = f"{node}, {what}," if node else what
        for line, message in faults:
            where = Position(line, 1) if line else WHOLE_FILE
            text = f"{message}; {who} at {at} names the file"
            self._findings.add(home.parent / name, where, text, rule=Rule.PLACES)
        self._texts[target] = _STAND_IN if faults else SEPARATOR.join(each for _, each in places)
        return self._texts[target]


def takes_places(element: Element, name: str, registry: NodeRegistry) -> bool:
    """Return whether an attribute can be a list of places: a declared port or a SubTree's entry."""
    if name in CONDITION_ATTRIBUTES or element.tag == NodeKind.SUBTREE.value:
        return name not in CONDITION_ATTRIBUTES
    node = registry.get(node_id_of(element))
    return node is not None and any(port.places and port.name == name for port in node.ports)


# --- the file -------------------------------------------------------------------------------------


def lines_of_lists(sources: Mapping[Path, bytes]) -> dict[str, str]:
    """Return the lines of the files of places among the texts of a mission, by place."""
    found: dict[str, str] = {}
    for path, data in sources.items():
        if path.suffix.lower() in FILE_SUFFIXES:
            for line, text in read_places(data, is_table=path.suffix.lower() == ".csv")[0]:
                found.setdefault(str(Place.parse(text)), f"{path}:{line}")
    return found


def read_places(
    data: bytes, *, is_table: bool
) -> tuple[list[tuple[int, str]], list[tuple[int, str]]]:
    """Return the places in a file, and its faults; each is a line number (0: all) and a text.

    `is_table`: the file has columns, as a CSV file.
    """
    try:
        lines = data.decode("utf-8-sig").split("\n")
    except UnicodeDecodeError as error:
        return [], [(data.count(b"\n", 0, error.start) + 1, "expected UTF-8 text")]
    columns: list[str] = []
    places: list[tuple[int, str]] = []
    faults: list[tuple[int, str]] = []
    for number, line in enumerate(map(str.strip, lines), 1):
        if not line or line.startswith(_COMMENT):
            continue
        if len(places) + len(faults) == MAX_PLACES:
            faults.append((number, f"more than {MAX_PLACES} places"))
            break
        try:
            if is_table and not columns:
                columns = _header(line)
                continue
            place = _row(columns, line) if columns else line.partition(_COMMENT)[0].strip()
            Place.parse(place)
            places.append((number, place))
        except InputError as error:
            faults.append((number, str(error)))
            if is_table and not columns:
                break
    if not places and not faults:
        faults.append((0, "the list is empty: expected at least one place"))
    return places, faults


def _cells(line: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], strict=True))]
    except csv.Error as error:
        raise ValueRangeError(f"expected cells with commas between them: {error}") from error


def _header(line: str) -> list[str]:
    """Return the names of the columns, or raise a ValueRangeError."""
    if "," not in line and any(sign in line for sign in ";\t"):
        got = "';'" if ";" in line else "tabs"
        raise ValueRangeError(f"expected commas between the cells, got {got}")
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
