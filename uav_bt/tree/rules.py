"""Rules of a mission, as a leaf of its tree; they are read before the take-off."""

from __future__ import annotations

from uav_bt.tree.leaf import Leaf
from uav_bt.tree.port import Port
from uav_bt.tree.status import SUCCESS, Status
from uav_bt.types.place import LandOn, MissionRules, area_corners
from uav_bt.types.place_frames import check_area


def _check_area(text: str) -> None:
    """Refuse a text that is neither empty nor an area."""
    if text:
        check_area(text)


class Rules(Leaf):
    """State the mission's time limit, where it may land and its area; SUCCESS always.

    The rules are read before the take-off, wherever the leaf stands in the tree, and hold for the
    whole flight. A mission has one `Rules` at most. A time limit of the command line replaces that
    of the rules. The area of a site and that of the rules both hold.
    """

    answers = (SUCCESS,)
    ports = (
        Port(
            "time_limit_s",
            float,
            default=0.0,
            least=0,
            most=86_400,
            doc="longest duration from the take-off command, s; 0: 300 s",
        ),
        Port(
            "land_on",
            str,
            default=LandOn.MARK.value,
            choices=tuple(each.value for each in LandOn),
            doc="where the flight must end: on the mark, on the ground beside it, anywhere; "
            "none: the mission never takes off",
        ),
        Port(
            "area",
            str,
            default="",
            check=_check_area,
            places=True,
            doc="corners of the polygon that the drone stays in, such as "
            "start:-1,-2;start:4,-2;start:4,2;start:-1,2; empty: no bound",
        ),
    )

    def update(self) -> Status:
        """Answer SUCCESS: the rules were read before."""
        return SUCCESS

    def stated(self) -> MissionRules:
        """Return the rules, by the values that the ports have before the tree runs."""
        time_limit_s, land_on, area = (self.initial_value(port) for port in self.ports)
        return MissionRules(
            time_limit_s=float(time_limit_s) if time_limit_s else None,
            land_on=LandOn(str(land_on)),
            area=area_corners(str(area)) if area else None,
        )
