"""Places of a mission, as tree files write them, and its rules, which may name some.

    start:2,0.5        2 m ahead of the take-off pose and 0.5 m to its right
    start:2,0.5,1.2    the same, 1.2 m above the ground
    start:2,0.5@90     the same, facing the right of the take-off heading
    body:1,0           1 m ahead of the drone at the time when a leaf starts
    lab:1.2,-0.5       in the coordinates of the scene's drawing
    mark               the landing mark
    object:3           object 3 of the map

A list may name files of places, `file:rounds.csv`, which the loader of tree files replaces by their
content (`uav_bt/tree/loading/places.py`).

Distances are in metres, headings in degrees. A heading counts clockwise from the take-off heading;
after `body:` it counts from the drone's heading, and after `lab:` counter-clockwise from the
drawing's x axis, as in scene files.
"""

from __future__ import annotations

import enum
import math
import re
from dataclasses import dataclass
from typing import Final, Self

from uav_bt.errors import ValueRangeError

SEPARATOR: Final = ";"  # of the places of a list, as of the elements of the format's loops
FILE_PREFIX: Final = "file:"  # before the name of a file beside the tree file, in a list
FILE_SUFFIXES: Final = (".csv", ".txt")
# As Python and spreadsheets write it
NUMBER: Final = r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"

_FURTHEST_M: Final = 1000.0  # largest coordinate; chosen, a typing error beyond it
_HEIGHTS_M: Final = (0.3, 20.0)  # as the flight heights of the take-off
_LEAST_CORNERS: Final = 3  # of an area
_PLACE: Final = re.compile(
    rf"(?:mark|object\s*:\s*(?P<object>\d{{1,9}})|"
    rf"(?P<frame>start|body|lab)\s*:\s*(?P<x>{NUMBER})\s*,\s*(?P<y>{NUMBER})"
    rf"(?:\s*,\s*(?P<height>{NUMBER}))?)(?:\s*@\s*(?P<deg>{NUMBER}))?"
)
_EXPECTED: Final = (
    "expected a place such as start:2,0 (metres ahead and to the right of the take-off pose), "
    "start:2,0,1.2@90 (with height and heading), body:1,0, lab:1.2,-0.5, mark or object:3"
)


class PlaceFrame(enum.Enum):
    """The origin and the axes of a place's coordinates."""

    START = "start"
    BODY = "body"
    LAB = "lab"
    MARK = "mark"
    OBJECT = "object"


@dataclass(frozen=True, kw_only=True)
class Place:
    """A place of a mission."""

    frame: PlaceFrame  # origin and axes of the coordinates
    # Distance ahead of the origin; in the lab, to the right of the drawing. 0 for a mark and an
    # object.
    x_m: float = 0.0
    y_m: float = 0.0  # distance to the right of the origin; in the lab, up the drawing
    # Height above the ground; None for the height that the mission flies at
    height_m: float | None = None
    # Heading at the place, clockwise, or counter-clockwise in the lab; None for any
    heading_rad: float | None = None
    object_id: int | None = None  # number of the object in the map; None in other frames

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the place of a text; blanks may stand around its separators."""
        bare = text.strip()
        if bare.startswith(FILE_PREFIX):
            ending = f"a file of places ends in {' or '.join(FILE_SUFFIXES)}"
            rule = f"{ending}, and a list in a tree file names it"
            raise ValueRangeError(f"{_EXPECTED}, got '{text}': {rule}")
        found = _PLACE.fullmatch(bare)
        if found is None:
            raise ValueRangeError(f"{_EXPECTED}, got '{text}'")
        named = PlaceFrame.MARK if found["object"] is None else PlaceFrame.OBJECT
        sides = (-_FURTHEST_M, _FURTHEST_M)
        height, deg = found["height"], found["deg"]
        return cls(
            frame=PlaceFrame(found["frame"]) if found["frame"] else named,
            x_m=_bounded(found["x"] or "0", sides, "a coordinate", text),
            y_m=_bounded(found["y"] or "0", sides, "a coordinate", text),
            height_m=None if height is None else _bounded(height, _HEIGHTS_M, "a height", text),
            heading_rad=None if deg is None else _heading(deg, text),
            object_id=None if found["object"] is None else int(found["object"]),
        )

    def __str__(self) -> str:
        """Return the place as a tree file writes it."""
        if self.frame is PlaceFrame.OBJECT:
            text = f"object:{self.object_id}"
        elif self.frame is PlaceFrame.MARK:
            text = "mark"
        else:
            text = f"{self.frame.value}:{_short(self.x_m)},{_short(self.y_m)}"
        if self.height_m is not None:
            text += f",{_short(self.height_m)}"
        if self.heading_rad is not None:
            text += f"@{_short(math.degrees(self.heading_rad), digits=1)}"
        return text


def parse_places(text: str) -> tuple[Place, ...]:
    """Return the places of a list, with `;` between them, in its order."""
    elements = [element for element in text.split(SEPARATOR) if element.strip()]
    if not elements:
        raise ValueRangeError(f"{_EXPECTED}, got an empty list")
    return tuple(Place.parse(element) for element in elements)


def area_corners(text: str) -> tuple[Place, ...]:
    """Return the corners of an area from a list of places in the frames start and lab."""
    corners = parse_places(text)
    for corner in corners:
        flat = corner.height_m is None and corner.heading_rad is None
        if not flat or corner.frame not in {PlaceFrame.START, PlaceFrame.LAB}:
            raise ValueRangeError(f"expected corners as start:x,y or lab:x,y, got '{corner}'")
    if len(corners) < _LEAST_CORNERS:
        expected = f"at least {_LEAST_CORNERS} corners of an area, with ';' between them"
        raise ValueRangeError(f"expected {expected}, got {len(corners)}")
    return corners


def _heading(text: str, place: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueRangeError(f"expected a heading in degrees, got {text} in the place '{place}'")
    return math.radians(math.remainder(value, 360.0))


def _bounded(text: str, bounds: tuple[float, float], what: str, place: str) -> float:
    value = float(text)
    if not bounds[0] <= value <= bounds[1]:
        expected = f"{what} of {bounds[0]:g} to {bounds[1]:g} m"
        raise ValueRangeError(f"expected {expected}, got {text} in the place '{place}'")
    return value


def _short(value: float, *, digits: int = 2) -> str:
    """Return a number without needless digits, and 0 without a sign."""
    return f"{round(value, digits) + 0.0:g}"


class LandOn(enum.StrEnum):
    """Where a mission may land for its flight to be a success."""

    MARK = "mark"  # on the landing mark
    GROUND = "ground"  # beside the landing mark
    ANY = "any"
    NONE = "none"  # nowhere: the mission never takes off


@dataclass(frozen=True, kw_only=True)
class MissionRules:
    """The rules of a mission. None: the mission does not say."""

    time_limit_s: float | None = None  # from the take-off command
    land_on: LandOn | None = None
    area: tuple[Place, ...] | None = None  # corners of a polygon, in the frames start or lab
