"""The drone of a flight, from its options and the place that it flies in."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Final

from uav_bt import plugins
from uav_bt.app.calibrated_drone import CalibratedDrone
from uav_bt.app.option_values import is_drone_config, refuse_incomplete, refuse_unusable
from uav_bt.app.options import FlightOptions
from uav_bt.app.place_of_flight import limits_of, scene_of, site_of
from uav_bt.app.rehearsed_drone import RehearsedDrone
from uav_bt.app.site import Site
from uav_bt.errors import InputError
from uav_bt.mission.limits import Limits
from uav_bt.protocols import Drone, DroneConfig

_CEILING_SLACK_M: Final = 0.6  # of the drone's own ceiling above the mission's


def make_drone(options: FlightOptions) -> Drone:
    """Return an unconnected drone.

    Raises:
        UnknownNameError: no drone is registered under that name.
        InputError: the drone refuses the options.
    """
    drone = _named_drone(options) if isinstance(options.drone, str) else _given_drone(options)
    refuse_incomplete(drone)
    site = site_of(options) or Site()
    # A lab states the camera of its real drone; that of a simulated one is known exactly.
    of_place = None if site.lab is not None and drone.scene is not None else site.camera
    camera = options.camera or of_place
    if camera is not None:
        drone = CalibratedDrone(drone, Path(camera))
    return RehearsedDrone(drone) if options.rehearse else drone


def _named_drone(options: FlightOptions) -> Drone:
    name, colon, address = str(options.drone).partition(":")
    config = _config_class(name, options)
    known = _field_names(config)
    if colon and "address" not in known:
        raise InputError(f"drone '{name}' takes no address, got '{address}'")
    refuse_unusable(options, f"drone '{name}'", known)
    settings = {**drone_settings(options), "address": address if colon else None}
    if "scene" in known:
        settings["scene"] = scene_of(options)
    given = {key: value for key, value in settings.items() if value is not None}
    return config(**{key: value for key, value in given.items() if key in known}).create()


def is_simulated(options: FlightOptions) -> bool:
    """Return whether the drone is named, and flies in a scene.

    Raises:
        UnknownNameError: no drone has that name.
    """
    named = isinstance(options.drone, str)
    return named and "scene" in _field_names(_config_class(options.drone_name, options))


def draws_images(options: FlightOptions) -> bool:
    """Return whether the drone is named, and its images have a size that can be chosen.

    Raises:
        UnknownNameError: no drone has that name.
    """
    named = isinstance(options.drone, str)
    return named and "image_size_px" in _field_names(_config_class(options.drone_name, options))


def _config_class(name: str, options: FlightOptions) -> type[DroneConfig]:
    """Return the configuration class of a named drone: registered, or from a file of leaves.

    Raises:
        UnknownNameError: no drone has that name.
    """
    registered = name in plugins.names(plugins.DRONES)
    own = {} if registered else options.own_parts.drones  # a plan is read without its leaves
    config: type[DroneConfig] = own[name] if name in own else plugins.load(plugins.DRONES, name)
    return config


def _given_drone(options: FlightOptions) -> Drone:
    """Return the drone of the options, or the one that their configuration makes."""
    drone: Any = options.drone
    if not is_drone_config(drone):
        return drone  # type: ignore[no-any-return]  # the options have checked it
    site, known = site_of(options), _field_names(type(drone))
    settings = {} if site is None else _place_settings(site, limits_of(options))
    settings["seed"] = options.seed
    given = {key: value for key, value in settings.items() if value is not None and key in known}
    made: Drone = (replace(drone, **given) if given else drone).create()
    return made


def _field_names(config: type) -> set[str]:
    return {each.name for each in fields(config)} if is_dataclass(config) else set()


def drone_settings(options: FlightOptions) -> dict[str, Any]:
    """Return the options that set up a drone, besides its scene, by field name of its config class.

    None: the drone's default holds.
    """
    return {
        "seed": options.seed,
        "profile": options.profile,
        "image_size_px": options.image_size_px,
        "realtime": options.realtime,
        "movers": options.movers or None,
        "vary_room": options.vary_room or None,
        **_place_settings(site_of(options) or Site(), limits_of(options)),
    }


def _place_settings(site: Site, limits: Limits) -> dict[str, Any]:
    return {
        "http_port": site.http_port,
        "rtsp_port": site.rtsp_port,
        "return_home": site.return_home,
        "speed_limit_mps": limits.speed_mps,
        "climb_limit_mps": limits.climb_mps,
        "yaw_rate_limit_radps": limits.yaw_rate_radps,
        # The drone's own ceiling counts from where it takes off, and lies above the mission's.
        "altitude_limit_m": limits.ceiling_m - site.take_off_surface_m + _CEILING_SLACK_M,
        "take_off_surface_m": site.take_off_surface_m,
        "video_latency_s": site.video_latency_s,
    }
