"""Places that a tree file names, in the drawing of a lab."""

from __future__ import annotations

from collections.abc import Iterator

from uav_bt.errors import ValueRangeError
from uav_bt.tree import MissionTree
from uav_bt.types import Pose2D
from uav_bt.types.place import Place, PlaceFrame, parse_places
from uav_bt.types.place_frames import start_to_lab


def drawn_places(
    tree: MissionTree, take_off: Pose2D | None
) -> Iterator[tuple[str, tuple[float, float]]]:
    """Yield the places of a mission whose position in the drawing is known.

    Args:
        tree: the mission.
        take_off: take-off pose in the drawing; without it only places in the lab's frame are known.

    Yields:
        The text of a place, and its x and y in the drawing, m.
    """
    seen: set[str] = set()
    for node in tree.nodes():
        for text in node.literals.values():
            for place in _places_of(text):
                at_m = _in_lab(place, take_off)
                if at_m is not None and str(place) not in seen:
                    seen.add(str(place))
                    yield str(place), at_m


def _places_of(text: object) -> tuple[Place, ...]:
    """Return the places of an attribute; none for other texts."""
    if not isinstance(text, str):
        return ()
    try:
        return parse_places(text)
    except ValueRangeError:
        return ()


def _in_lab(place: Place, take_off: Pose2D | None) -> tuple[float, float] | None:
    if place.frame is PlaceFrame.LAB:
        return place.x_m, place.y_m
    if place.frame is not PlaceFrame.START or take_off is None:
        return None
    there = start_to_lab(Pose2D(x_m=place.x_m, y_m=place.y_m, yaw_rad=0.0), take_off)
    return there.x_m, there.y_m
