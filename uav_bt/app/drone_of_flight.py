"""The drone of a flight, from its options and place; its faults; drones around others."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np

from perception.camera.camera_file import Undistorter, load_camera
from uav_bt import plugins
from uav_bt.app.option_values import is_drone_config, refuse_incomplete, refuse_unusable
from uav_bt.app.options import OF_DRONE, FlightOptions
from uav_bt.app.place import limits_of, scene_of
from uav_bt.app.site import Site
from uav_bt.board import PHASE
from uav_bt.errors import InputError, UnknownNameError
from uav_bt.mission.drone_wrapper import DroneWrapper
from uav_bt.protocols import Drone, DroneConfig
from uav_bt.testing.drone import ScriptedDrone
from uav_bt.testing.fault_kinds import FAULTS
from uav_bt.testing.faults import RANDOM, START, Fault, FaultyDrone
from uav_bt.tree import MissionTree
from uav_bt.types import CameraModel, Command, DroneState, Frame, MissionPhase, Observation, Release
from uav_bt.types.commands import Phase

_CEILING_SLACK_M: Final = 0.6  # of the drone's own ceiling above the mission's
_MOVEMENT_TICKS: Final = 20  # of a rehearsed movement: 2 s
# Faults after which nothing is flown, or no command can land the drone.
_HOPELESS: Final = frozenset(
    {"deaf", "link-lost", "motors-cut", "no-landing", "no-take-off", "pilot", "send-raises"}
)
_COUNTS: Final = (0, 1, 2, 3)  # equally probable numbers of faults
_MOVERS: Final = (0, 0, 1)  # equally probable numbers of movers
_PHASES: Final = (
    *[MissionPhase.EXPLORE] * 3,
    *[MissionPhase.LAND] * 2,  # short, and the most depends on it
    *(MissionPhase.TAKE_OFF, MissionPhase.APPROACH, MissionPhase.CENTER),
)
_DELAY_S: Final = {MissionPhase.EXPLORE: 30.0}  # longest delay after the phase's start
_OTHER_DELAY_S: Final = 2.0
_LASTS_S: Final = (0.5, 20.0)
_STAYS: Final = 0.3  # share of the faults that last to the end
_LEVELS: Final = (0.3, 1.5)  # times the kind's default level
Seen = TypeVar("Seen", Frame, DroneState)


def make_drone(options: FlightOptions) -> Drone:
    """Return an unconnected drone.

    Raises:
        UnknownNameError: no drone is registered under that name.
        InputError: the drone refuses the options.
    """
    drone: Any = options.drone
    if isinstance(drone, str):
        drone = _named_drone(options)
    elif is_drone_config(drone):
        place = {} if options.place is None else _place_settings(options)
        given = _known({**place, "seed": options.seed}, _field_names(type(drone)))
        drone = (replace(drone, **given) if given else drone).create()
    refuse_incomplete(drone)
    site = options.place or Site()
    # A lab states the camera of its real drone.
    of_place = None if site.lab is not None and drone.scene is not None else site.camera
    if camera := options.camera or of_place:
        drone = CalibratedDrone(drone, Path(camera))
    return RehearsedDrone(drone) if options.rehearse else drone


def _named_drone(options: FlightOptions) -> Drone:
    config, (name, colon, address) = _config_class(options), str(options.drone).partition(":")
    known = _field_names(config)
    if colon and "address" not in known:
        raise InputError(f"drone '{name}' takes no address, got '{address}'")
    cure = "leave it out, as this drone has no such setting"
    refuse_unusable(options, f"drone '{name}'", known, cure)
    settings = {each: getattr(options, each) for each in OF_DRONE} | _place_settings(options)
    settings["address"] = address if colon else None
    if "scene" in known:
        settings["scene"] = scene_of(options)
    return config(**_known(settings, known)).create()


def is_simulated(options: FlightOptions) -> bool:
    """Return whether the drone is named, and flies in a scene."""
    return isinstance(options.drone, str) and "scene" in _field_names(_config_class(options))


def _config_class(options: FlightOptions) -> type[DroneConfig]:
    """Return the configuration class of a named drone."""
    name = str(options.drone).partition(":")[0]
    registered = name in plugins.names(plugins.DRONES)
    own = {} if registered else options.own_parts.drones  # a plan is read without its leaves
    config: type[DroneConfig] = own[name] if name in own else plugins.load(plugins.DRONES, name)
    return config


def _field_names(config: type) -> set[str]:
    return {each.name for each in fields(config)} if is_dataclass(config) else set()


def _known(settings: dict[str, Any], names: Collection[str]) -> dict[str, Any]:
    """Return the settings that a configuration has; for None its default holds."""
    return {key: value for key, value in settings.items() if value is not None and key in names}


def _place_settings(options: FlightOptions) -> dict[str, Any]:
    site, limits = options.place or Site(), limits_of(options)
    return {
        "http_port": site.http_port,
        "rtsp_port": site.rtsp_port,
        "return_home": site.return_home,
        "speed_limit_mps": limits.speed_mps,
        "climb_limit_mps": limits.climb_mps,
        "yaw_rate_limit_radps": limits.yaw_rate_radps,
        # The drone's own ceiling counts from where it takes off.
        "altitude_limit_m": limits.ceiling_m - site.take_off_surface_m + _CEILING_SLACK_M,
        "take_off_surface_m": site.take_off_surface_m,
        "video_latency_s": site.video_latency_s,
    }


def drawn(options: FlightOptions) -> FlightOptions:
    """Return the options; with `RANDOM` room, movers and faults come from the seed."""
    if RANDOM not in options.faults:
        return options
    # The same for each tree, so that trees can be compared.
    # The scene's name, because one file has many paths.
    scene = make_drone(options).scene
    name = None if scene is None else scene.name
    rng = np.random.default_rng([options.seed, *f"{RANDOM} {name}".encode()])
    movers = options.movers + int(rng.choice(_MOVERS))
    faults = [_drawn_fault(rng) for _ in range(int(rng.choice(_COUNTS)))]
    given = [text for text in options.faults if text != RANDOM]
    return replace(options, vary_room=True, movers=movers, faults=(*given, *faults))


def _drawn_fault(rng: np.random.Generator) -> str:
    kinds = [kind for kind in FAULTS.values() if kind.name not in _HOPELESS]
    kind = kinds[int(rng.integers(len(kinds)))]
    phase = _PHASES[int(rng.integers(len(_PHASES)))]
    times = float(rng.uniform(*_LEVELS))
    delay_s = round(float(rng.uniform(0.0, _DELAY_S.get(phase, _OTHER_DELAY_S))), 1)
    lasts_s = round(float(rng.uniform(*_LASTS_S)), 1)
    duration_s = np.inf if rng.random() < _STAYS else lasts_s
    level = None if kind.level is None else float(f"{times * kind.level:.2g}")
    return str(Fault(kind=kind, level=level, phase=phase, delay_s=delay_s, duration_s=duration_s))


def check_faults(texts: Sequence[str]) -> list[Fault]:
    """Return the faults of texts, without `RANDOM`."""
    return [Fault.parse(text) for text in texts if text != RANDOM]


def check_phases(mission: MissionTree, faults: Sequence[Fault]) -> None:
    """Refuse faults of phases that a mission cannot have."""
    members = {str(phase) for kind in Phase.__subclasses__() for phase in kind}
    # A moving leaf that writes no phase is one by its own name.
    leaves = {leaf.name for leaf in mission.leaves() if leaf.moves and PHASE not in leaf.writes}
    known = {name.replace("_", " ") for name in (START, *members, *leaves)}
    for fault in faults:
        if fault.phase.replace("_", " ") not in known:
            raise UnknownNameError(f"phase of the fault '{fault}':", fault.phase, known)


def with_faults(drone: Drone, texts: Sequence[str]) -> Drone:
    """Return an unconnected drone with faults."""
    faults = check_faults(texts)
    if faults and drone.live:
        raise InputError("faults are for simulated drones; a real one must not get them")
    for fault in faults:
        drone = FaultyDrone(drone, fault)
    return drone


class CalibratedDrone(DroneWrapper):
    """Wraps a drone and replaces its intrinsics by those of a camera file.

    The file fits every frame size of the same aspect; it is read once the size is known.
    """

    def __init__(self, drone: Drone, camera_file: Path) -> None:
        super().__init__(drone)
        self._file = camera_file
        self._undistorter: Undistorter  # since it was connected
        self._last: tuple[Frame, Frame] | None = None  # as sent, and undistorted

    @property
    def camera(self) -> CameraModel:
        """The calibrated intrinsics at the frames' size, of undistorted frames."""
        return self._undistorter.camera

    def connect(self) -> None:
        """Connect the drone and read the camera file."""
        self._drone.connect()
        reported = self._drone.camera
        # A calibration board does not show where on the drone the lens sits.
        size_px, offset_m = (reported.width_px, reported.height_px), reported.forward_offset_m
        calibrated = load_camera(self._file, size_px=size_px, forward_offset_m=offset_m)
        self._undistorter = Undistorter(calibrated)

    def observe(self) -> Observation:
        """Return the newest state, and the newest frame undistorted."""
        seen = self._drone.observe()
        if seen.frame is None:
            return seen
        if self._last is None or self._last[0] is not seen.frame:
            straight = replace(seen.frame, image=self._undistorter.undistort(seen.frame.image))
            self._last = seen.frame, straight
        return replace(seen, frame=self._last[1])


class RehearsedDrone(DroneWrapper):
    """A rehearsal: live video and telemetry, and a drone that stays where it is.

    It takes off, moves and lands in numbers only, so that tree and perception run as they would.
    Only the gimbal is pointed for real. A person holds the drone at flight height.
    """

    referee = None  # there is no truth about a pretended flight
    stills = None  # a photograph would be a command

    def __init__(self, drone: Drone) -> None:
        super().__init__(drone)
        self._pretended = ScriptedDrone(movement_ticks=_MOVEMENT_TICKS)

    def observe(self) -> Observation:
        """Return the drone's observation, at the pretended height."""
        seen, now = self._drone.observe(), self._pretended.state
        state = replace(self._raised(seen.state), flying=now.flying, movement=now.movement)
        return Observation(frame=seen.frame and self._raised(seen.frame), state=state)

    def send(self, command: Command) -> Command:
        """Pretend to obey; point the camera. Return the command as it would be sent."""
        self._pretended.send(command)
        if command.gimbal is None:
            return command
        sent = self._drone.send(Command(movement=Release(), gimbal=command.gimbal))
        return replace(command, gimbal=sent.gimbal)

    def _raised(self, seen: Seen) -> Seen:
        height_m = self._pretended.state.altitude_m
        names = ("altitude_m", "height_m", "height_above_ground_m")
        return replace(seen, **{name: getattr(seen, name) + height_m for name in names})
