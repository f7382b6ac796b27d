"""Limits, landing mark and classes of a flight, from its options, its site and its scene."""

from __future__ import annotations

from uav_bt.app.options import FlightOptions
from uav_bt.app.site import Site
from uav_bt.errors import InputError
from uav_bt.lab.classes import LabClasses
from uav_bt.lab.shipped import default_mark, load_lab
from uav_bt.mission.limits import Limits
from uav_bt.protocols import Drone
from uav_bt.types import LandingMark


def site_of(options: FlightOptions) -> Site | None:
    """Return the site that was read from the options' site file."""
    return options.site if isinstance(options.site, Site) else None


def limits_of(options: FlightOptions) -> Limits:
    """Return the limits of all commands. A site's limits replace the options'."""
    site = site_of(options)
    return options.limits if site is None else site.limits


def classes_of(drone: Drone) -> LabClasses:
    """Return the classes of the scene's lab; on a real drone those of the default lab."""
    return load_lab().classes if drone.scene is None else drone.scene.classes


def mark_of(options: FlightOptions, drone: Drone) -> LandingMark:
    """Return the landing mark, from the site or the scene of a simulated drone.

    Args:
        options: options of the flight.
        drone: drone that flies.

    Raises:
        InputError: site and scene state different marks.
    """
    site = site_of(options)
    stated = None if site is None else site.mark
    mark = None if drone.scene is None else drone.scene.mark
    if drone.scene is None or mark is None:
        return stated or default_mark()
    if stated not in {None, mark}:
        raise InputError(
            f"the site's mark ({stated}) is not that of scene '{drone.scene.name}' ({mark}): "
            "remove 'mark' from the site file, or change 'helipad' of the scene"
        )
    return mark
