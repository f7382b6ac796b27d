"""Lab, scene, limits, landing mark and classes of a flight, from its options and its drone."""

from __future__ import annotations

from uav_bt.app.options import FlightOptions
from uav_bt.app.site import Site
from uav_bt.errors import InputError
from uav_bt.lab.lab import SCENES_FOLDER, Lab
from uav_bt.lab.shipped import DEFAULT_LAB, default_mark, load_lab
from uav_bt.mission.limits import Limits
from uav_bt.protocols import Drone, Scene
from uav_bt.types import LandingMark, Pose2D


def site_of(options: FlightOptions) -> Site | None:
    """Return the site of the options, or that of their lab; None without both."""
    return options.place


def lab_of(options: FlightOptions, scene: Scene | None) -> Lab | None:
    """Return the lab of a flight: that of the options or of the scene; None if neither names one.

    Args:
        options: options of the flight.
        scene: scene of a simulated drone; None on a real one.

    Raises:
        InputError: The scene belongs to another lab than that of the options.
    """
    lab = options.lab
    of_scene = None if scene is None else load_lab(scene.lab)
    if not isinstance(lab, Lab):
        return of_scene
    if scene is not None and of_scene is not None and not _same(lab, of_scene):
        raise InputError(
            f"scene '{scene.name}' belongs to the lab '{of_scene.name}', and the flight is in the "
            f"lab '{lab.name}': choose a scene of that lab ({_scenes_text(lab)}), or --lab "
            f"{of_scene.name}"
        )
    return lab


def scene_of(options: FlightOptions) -> str | None:
    """Return the scene of a simulated drone: its name or file; None for the drone's default.

    Without a scene in the options it is the first of the lab's folder `scenes`, by name.

    Args:
        options: options of the flight.

    Raises:
        InputError: The lab has no scenes.
    """
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
        f"{lab.folder / SCENES_FOLDER}/NAME.yaml, give --scene, or fly a real drone with --drone"
    )


def _same(one: Lab, other: Lab) -> bool:
    return one is other or one.file.resolve() == other.file.resolve()


def _scenes_text(lab: Lab) -> str:
    if lab.scenes:
        return ", ".join(lab.scenes)
    return "the shipped ones" if _same(lab, load_lab(DEFAULT_LAB)) else "it has none"


def limits_of(options: FlightOptions) -> Limits:
    """Return the limits of all commands: of options, site or lab; the stricter where both state."""
    site, given = site_of(options), options.limits
    if site is None or given is None:
        return given or (site or Site()).limits
    greater = {"floor_m", "critical_battery"}
    return Limits(
        **{
            name: (max if name in greater else min)(limit, getattr(site.limits, name))
            for name, limit in vars(given).items()
        }
    )


def mark_of(options: FlightOptions, drone: Drone) -> LandingMark:
    """Return the landing mark, from site or lab, or from the scene of a simulated drone.

    A scene may have another mark than its lab, and then has the mark of the scene.

    Args:
        options: options of the flight.
        drone: drone that flies.

    Raises:
        InputError: site file and scene state different marks.
    """
    site = site_of(options)
    stated = None if site is None else site.mark
    mark = None if drone.scene is None else drone.scene.mark
    if drone.scene is None or mark is None:
        return stated or default_mark()
    if options.lab is None and stated not in {None, mark}:
        raise InputError(
            f"the site's mark ({stated}) is not that of scene '{drone.scene.name}' ({mark}): "
            "remove 'mark' from the site file, or change 'helipad' of the scene"
        )
    return mark


def mark_pose_of(options: FlightOptions, drone: Drone) -> Pose2D | None:
    """Return the pose of the landing mark in the lab's drawing, from scene, site or lab.

    Args:
        options: options of the flight.
        drone: drone that flies.

    Returns:
        The pose, yaw counter-clockwise; None if unknown.
    """
    if drone.scene is not None:
        return drone.scene.mark_pose
    site = site_of(options)
    return None if site is None else site.mark_pose
