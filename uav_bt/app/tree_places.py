"""Places that a tree file names, in the drawing of a lab."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

from uav_bt.errors import ValueRangeError
from uav_bt.tree import MissionTree
from uav_bt.types import Pose2D
from uav_bt.types.place import Place, PlaceFrame, parse_places
from uav_bt.types.place_frames import start_to_lab


def drawn_places(
    tree: MissionTree, take_off: Pose2D | None
) -> Iterator[tuple[str, tuple[float, float]]]:
    """Yield the places of a mission whose position in the drawing is known.

    Yields:
        The text of a place, and its x and y in the drawing, m. Without a take-off pose in the
        drawing only places in the lab's frame are known.
    """
    found: dict[str, Place] = {}
    for text in (each for node in tree.nodes() for each in node.literals.values()):
        with suppress(ValueRangeError):  # other attributes are no places
            found |= {str(one): one for one in parse_places(text)} if isinstance(text, str) else {}
    for name, place in found.items():
        there = Pose2D(x_m=place.x_m, y_m=place.y_m, yaw_rad=0.0)
        if place.frame is PlaceFrame.START and take_off is not None:
            there = start_to_lab(there, take_off)
        elif place.frame is not PlaceFrame.LAB:
            continue
        yield name, (there.x_m, there.y_m)
