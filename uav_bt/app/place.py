"""Which lab, scene, limits, landing mark, area and rules hold in a flight."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from perception.networks.weights_file import ANY, SHIPPED_UNET, TEACHER
from uav_bt.app.options import FlightOptions
from uav_bt.app.site import Site, has_paper_classes
from uav_bt.board import CLASS_MAP
from uav_bt.errors import FileError, InputError
from uav_bt.lab.classes import LabClasses
from uav_bt.lab.lab import SCENES_FOLDER, Lab
from uav_bt.lab.shipped import DEFAULT_LAB, default_mark, lab_address, load_lab
from uav_bt.mission.judge import JudgeConfig
from uav_bt.mission.limits import Limits
from uav_bt.protocols import Drone, Scene
from uav_bt.tree import MissionTree
from uav_bt.tree.rules import Rules
from uav_bt.types import LandingMark, Pose2D
from uav_bt.types.area import Area
from uav_bt.types.place import LandOn, MissionRules, PlaceFrame
from uav_bt.types.place_frames import from_start

_LARGER: Final = frozenset({"floor_m", "critical_battery"})  # the larger is stricter


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """What holds in a flight. Poses are in the lab's drawing, yaw counter-clockwise."""

    lab: Lab | None  # None: neither options nor scene name one
    classes: LabClasses
    site: Site  # of the options, or of their lab
    limits: Limits
    mark: LandingMark
    mark_pose: Pose2D | None  # None: unknown
    take_off: Pose2D | None  # None: unknown
    judge: JudgeConfig  # with these rules
    area: Area | None = None  # relative to the take-off pose; None: no bound


def conditions_of(
    options: FlightOptions, mission: MissionTree, drone: Drone, *, recorded: bool = False
) -> Conditions:
    """Return what holds in a flight, with this precedence.

    Options come before the mission's rules, these before the scene of a simulated drone, this
    before lab or site, these before the ports of the tree (`app/loading.py`). Of two limits the
    smaller one holds, and of two areas both.

    `recorded`: whether a record states the area, and the flight is over.
    """
    scene, site, rules = drone.scene, options.place or Site(), rules_of(mission)
    lab = lab_of(options, scene)
    judge = options.judge.under(rules)
    if options.rehearse and judge.land_on is not LandOn.NONE:
        judge = replace(judge, land_on=LandOn.ANY)  # where the person holds the drone
    known = site if scene is None else scene
    mark = site.mark if scene is None or scene.mark is None else scene.mark
    if scene is not None and options.lab is None and site.mark not in {None, mark}:
        raise InputError(
            f"the site's mark ({site.mark}) is not that of scene '{scene.name}' ({mark}): drop one"
        )
    found = Conditions(
        lab=lab,
        classes=(lab or load_lab()).classes,
        site=site,
        limits=limits_of(options),
        mark=mark or default_mark(),
        mark_pose=known.mark_pose,
        take_off=known.take_off_pose,
        judge=judge,
    )
    if recorded:
        return found
    _check_mark(judge, scene, lab)
    return replace(found, area=area_of(rules, site, known.take_off_pose))


def rules_of(mission: MissionTree) -> MissionRules:
    """Return the rules that a mission states; a mission without any states nothing."""
    stated = (leaf.stated() for leaf in mission.leaves() if isinstance(leaf, Rules))
    return next(stated, MissionRules())


def limits_of(options: FlightOptions) -> Limits:
    """Return the limits of options, site or lab; the stricter where both state them."""
    given, of_site = options.limits, (options.place or Site()).limits
    if given is None or of_site is None:
        return given or of_site or Limits()
    stricter = {
        name: (max if name in _LARGER else min)(limit, getattr(of_site, name))
        for name, limit in vars(given).items()
    }
    return Limits(**stricter)


def lab_of(options: FlightOptions, scene: Scene | None) -> Lab | None:
    """Return the lab of options or scene; refuse a scene of another lab."""
    lab, of_scene = options.lab, None if scene is None else load_lab(scene.lab)
    if not isinstance(lab, Lab):
        return of_scene
    if scene is not None and of_scene is not None and not _same(lab, of_scene):
        file = lab.scenes.get(scene.name, Path(scene_of(options) or ""))
        lines = file.read_text(encoding="utf-8").splitlines() if file.is_file() else []
        stated = [number for number, line in enumerate(lines, 1) if line.startswith("lab:")]
        if stated and file in lab.scenes.values():
            cure = f"remove this key, or write lab: {lab.name}"
            raise FileError(file, f"the scene is for the lab '{scene.lab}': {cure}", stated[0])
        raise InputError(
            f"scene '{scene.name}' belongs to the lab '{of_scene.name}', and the flight is in the "
            f"lab '{lab.name}': choose one of its scenes ({', '.join(lab.scenes) or 'none'}), or "
            "that lab"
        )
    return lab


def scene_of(options: FlightOptions) -> str | None:
    """Return the name or file of the scene: of the options, or the lab's first; None: default."""
    asked, lab = options.scene, options.lab
    if not isinstance(lab, Lab):
        return None if asked is None else str(asked)
    scenes = lab.scenes
    if asked is not None:
        return str(scenes.get(str(asked), asked))
    if scenes:
        return str(next(iter(scenes.values())))
    if _same(lab, load_lab(DEFAULT_LAB)):
        return None
    raise InputError(
        f"the lab '{lab.name}' has no scene, and a simulated drone flies in one: add "
        f"{lab.folder / SCENES_FOLDER}/NAME.yaml, or give --scene or a real --drone"
    )


def _same(one: Lab, other: Lab) -> bool:
    return one is other or one.file.resolve() == other.file.resolve()


def _check_mark(judge: JudgeConfig, scene: Scene | None, lab: Lab | None) -> None:
    """Refuse a flight that must land on a mark where there is none."""
    if judge.land_on not in {None, LandOn.MARK}:
        return
    place: Scene | Lab | None = scene or lab
    if place is not None and place.mark is None:
        what = f"scene '{place.name}'" if scene is not None else f"the lab '{place.name}'"
        raise InputError(
            f"{what} has no landing mark, and the mission must land on one: state where it may "
            'land, such as <Rules land_on="any"/> in the tree'
        )


def check_area(mission: MissionTree, site: Site) -> None:
    """Refuse areas of rules and site that do not fit together."""
    rules = rules_of(mission)
    corners = [*(rules.area or ()), *(site.area or ())]
    # The scene may still know the take-off pose.
    if site.take_off_pose is not None or all(each.frame is PlaceFrame.START for each in corners):
        area_of(rules, site, site.take_off_pose)


def area_of(rules: MissionRules, site: Site, take_off: Pose2D | None) -> Area | None:
    """Return where the areas of rules and site both hold; None without one."""
    given = [corners for corners in (rules.area, site.area) if corners is not None]
    if not given:
        return None
    points = [[from_start(corner, take_off) for corner in corners] for corners in given]
    if any(None in polygon for polygon in points):
        raise InputError(
            "area: the take-off pose in the lab's drawing is unknown: name the corners as start:x,y"
        )
    area = Area(tuple(tuple(filter(None, polygon)) for polygon in points))
    if area.margin_m(0.0, 0.0) <= 0.0:
        raise InputError(
            "area: the take-off point, start:0,0, lies outside the area "
            f"{'; '.join(map(str, given[0]))}: the drone could only fly back in"
        )
    return area


def refuse_foreign_network(mission: MissionTree, lab: Lab | None, *, named: bool) -> None:
    """Refuse a mission whose network has other classes than the lab.

    `named`: whether the options name the lab, and not only the scene.
    """
    if lab is None or has_paper_classes(lab):
        return
    address = lab_address(lab)
    remedy = f"add --lab {address} for the lab's network"
    if named:
        remedy = f"set its model to '{ANY}', or make a network by `uav-bt lab train {address}`"
    for leaf in mission.leaves():
        values = {port.name: leaf.initial_value(port) for port in leaf.ports}
        shipped = values.get("model") in (SHIPPED_UNET, TEACHER)
        if CLASS_MAP in leaf.writes and shipped and not values.get("classes"):
            raise InputError(
                f"'{leaf.path}' segments with the network '{values['model']}', which does not have "
                f"the classes of the lab '{lab.name}': {remedy}"
            )
