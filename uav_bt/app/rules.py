"""The rules of a flight: those of its mission, its site and its options together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from uav_bt.app.site import Site
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.lab.lab import Lab
from uav_bt.mission.judge import JudgeConfig
from uav_bt.protocols import Drone
from uav_bt.tree import MissionTree
from uav_bt.tree.rules import Rules
from uav_bt.types import Pose2D
from uav_bt.types.area import Area
from uav_bt.types.place import LandOn, MissionRules, Place, PlaceFrame
from uav_bt.types.place_frames import lab_to_start


def rules_of(mission: MissionTree) -> MissionRules:
    """Return the rules that a mission states; a mission without any states nothing.

    Args:
        mission: It was checked, so that it has one `Rules` at most.
    """
    stated = (leaf.stated() for leaf in mission.leaves() if isinstance(leaf, Rules))
    return next(stated, MissionRules())


def judge_of(options: JudgeConfig, rules: MissionRules, *, rehearse: bool) -> JudgeConfig:
    """Return the rules of a flight: its options, completed by the rules of the mission.

    Args:
        options: Of the flight.
        rules: Of the mission.
        rehearse: Whether the motors stay off; then the drone lands where the person holds it.
    """
    judge = options.under(rules)
    if rehearse and judge.land_on is not LandOn.NONE:
        return replace(judge, land_on=LandOn.ANY)
    return judge


def area_of(rules: MissionRules, site: Site, take_off: Pose2D | None) -> Area | None:
    """Return the area of a flight, in which rules and site both hold; None without one.

    Args:
        rules: Rules of the mission.
        site: Place that is flown in.
        take_off: Take-off pose in the drawing of the lab; None if unknown.

    Raises:
        InputError: An area has crossing sides, does not contain the take-off point, or is given in
            the lab's drawing, in which the take-off pose is unknown.
    """
    given = [corners for corners in (rules.area, site.area) if corners is not None]
    if not given:
        return None
    try:
        area = Area(tuple(tuple(_corners(corners, take_off)) for corners in given))
    except ValueRangeError as error:
        raise InputError(f"area: {error}") from error
    if area.margin_m(0.0, 0.0) <= 0.0:
        raise InputError(
            "area: the take-off point, start:0,0, lies outside the area "
            f"{'; '.join(map(str, given[0]))}: the drone could only fly back in"
        )
    return area


def _corners(corners: Sequence[Place], take_off: Pose2D | None) -> Iterator[tuple[float, float]]:
    for corner in corners:
        if corner.frame is not PlaceFrame.LAB:
            yield corner.x_m, corner.y_m
            continue
        if take_off is None:
            raise InputError(
                f"area: '{corner}' is a place of the lab's drawing, in which the take-off pose is "
                "unknown: name the corners as start:x,y"
            )
        place = lab_to_start(Pose2D(x_m=corner.x_m, y_m=corner.y_m, yaw_rad=0.0), take_off)
        yield place.x_m, place.y_m


def take_off_pose(site: Site | None, drone: Drone) -> Pose2D | None:
    """Return the take-off pose in the lab's drawing, from the scene or the site; None if unknown.

    Args:
        site: Site of the flight.
        drone: Drone that flies; a simulated one has a scene.
    """
    if drone.scene is not None:
        return drone.scene.take_off_pose
    return None if site is None else site.take_off_pose


def check_mark(judge: JudgeConfig, drone: Drone, lab: Lab | None = None) -> None:
    """Refuse a flight that must end on a landing mark that its scene or its lab does not have.

    Args:
        judge: Rules of the flight, with those of the mission.
        drone: Drone that flies.
        lab: Lab of the flight; None if none is named.

    Raises:
        InputError: There is no landing mark.
    """
    if judge.land_on not in {None, LandOn.MARK}:
        return
    scene = drone.scene
    if scene is not None and scene.mark is None:
        lacks = f"scene '{scene.name}' has no landing mark, and the mission must land on one"
    elif scene is None and lab is not None and lab.mark is None:
        lacks = f"the lab '{lab.name}' states no landing mark, and the mission must land on one"
    else:
        return
    advice = 'state where it may land, such as <Rules land_on="any"/> in the tree'
    raise InputError(f"{lacks}: {advice}")
