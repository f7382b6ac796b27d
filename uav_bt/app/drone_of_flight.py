"""The drone of a flight, from its options and the place that it flies in; drones around others."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Final, TypeVar

from perception.camera.camera_file import Undistorter, load_camera
from uav_bt import plugins
from uav_bt.app.option_values import is_drone_config, refuse_incomplete, refuse_unusable
from uav_bt.app.options import OF_DRONE, FlightOptions
from uav_bt.app.place import limits_of, scene_of
from uav_bt.app.site import Site
from uav_bt.errors import DroneError, InputError
from uav_bt.mission.drone_wrapper import DroneWrapper
from uav_bt.protocols import Drone, DroneConfig
from uav_bt.types import (
    CameraModel,
    Command,
    CutMotors,
    DroneState,
    FlyingState,
    Frame,
    Hover,
    Land,
    MoveBy,
    Movement,
    MovementState,
    MovementStatus,
    Observation,
    Release,
    TakeOff,
    Velocity,
)

_CEILING_SLACK_M: Final = 0.6  # of the drone's own ceiling above the mission's
# Of a rehearsal.
_TAKE_OFF_S: Final = 3.0  # time in which an ANAFI climbs to 1 m
_TAKE_OFF_M: Final = 1.0
_LANDING_S: Final = 3.0
_PACE_MPS: Final = 0.5
_PACE_RADPS: Final = 0.8
Seen = TypeVar("Seen", Frame, DroneState)
_FLIES: Final = frozenset({FlyingState.HOVERING, FlyingState.FLYING})


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
    # A lab states the camera of its real drone; that of a simulated one is known exactly.
    of_place = None if site.lab is not None and drone.scene is not None else site.camera
    if camera := options.camera or of_place:
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
    return config(**_known(settings, known)).create()


def is_simulated(options: FlightOptions) -> bool:
    """Return whether the drone is named, and flies in a scene."""
    return "scene" in _fields_of_named(options)


def draws_images(options: FlightOptions) -> bool:
    """Return whether the drone is named, and its images have a size that can be chosen."""
    return "image_size_px" in _fields_of_named(options)


def _fields_of_named(options: FlightOptions) -> set[str]:
    if not isinstance(options.drone, str):
        return set()
    return _field_names(_config_class(options.drone.partition(":")[0], options))


def _config_class(name: str, options: FlightOptions) -> type[DroneConfig]:
    """Return the configuration class of a named drone: registered, or from a file of leaves."""
    registered = name in plugins.names(plugins.DRONES)
    own = {} if registered else options.own_parts.drones  # a plan is read without its leaves
    config: type[DroneConfig] = own[name] if name in own else plugins.load(plugins.DRONES, name)
    return config


def _field_names(config: type) -> set[str]:
    return {each.name for each in fields(config)} if is_dataclass(config) else set()


def _known(settings: dict[str, Any], names: Collection[str]) -> dict[str, Any]:
    return {key: value for key, value in settings.items() if value is not None and key in names}


def drone_settings(options: FlightOptions) -> dict[str, Any]:
    """Return what sets up a drone, by field name of its configuration class.

    None: the drone's default holds.
    """
    return {name: getattr(options, name) for name in OF_DRONE} | _place_settings(options)


def _place_settings(options: FlightOptions) -> dict[str, Any]:
    site, limits = options.place or Site(), limits_of(options)
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


class CalibratedDrone(DroneWrapper):
    """Flies another drone, with a camera file in place of the intrinsics that it reports.

    Args:
        drone: Drone that flies; not connected yet.
        camera_file: made by `uav-bt lab calibrate`, at any size of the frames' aspect. It is read
            when the size of the frames is known.
    """

    def __init__(self, drone: Drone, camera_file: Path) -> None:
        super().__init__(drone)
        self._file = camera_file
        self._undistorter: Undistorter | None = None
        self._last: tuple[Frame, Frame] | None = None  # as sent, and undistorted

    @property
    def camera(self) -> CameraModel:
        """The calibrated intrinsics at the frames' size, of undistorted frames."""
        return self._ready().camera

    def connect(self) -> None:
        """Connect the drone and read the camera file."""
        self._drone.connect()
        try:
            reported = self._drone.camera
            calibrated = load_camera(
                self._file,
                size_px=(reported.width_px, reported.height_px),
                # A calibration board does not show where on the drone the lens sits.
                forward_offset_m=reported.forward_offset_m,
            )
        except Exception:
            self._drone.disconnect()
            raise
        self._undistorter = Undistorter(calibrated)

    def observe(self) -> Observation:
        """Return the newest state, and the newest frame undistorted."""
        undistorter, seen = self._ready(), self._drone.observe()
        if seen.frame is None:
            return seen
        if self._last is None or self._last[0] is not seen.frame:
            straight = replace(seen.frame, image=undistorter.undistort(seen.frame.image))
            self._last = seen.frame, straight
        return replace(seen, frame=self._last[1])

    def _ready(self) -> Undistorter:
        if self._undistorter is None:
            raise DroneError("the calibrated drone is not connected: call connect() first")
        return self._undistorter


@dataclass(frozen=True, kw_only=True)
class _Pretence:
    flying: FlyingState = FlyingState.LANDED
    until_s: float = math.inf  # end of the present movement
    altitude_m: float = 0.0
    climb_mps: float = 0.0
    move: MoveBy | None = None
    status: MovementStatus | None = None
    last_s: float | None = None


class RehearsedDrone(DroneWrapper):
    """A rehearsal: live video and telemetry, and a drone that stays where it is.

    The mission flies a pretended drone: it takes off, moves and lands in numbers only, at once and
    without error, so that tree and perception run as they would. Only the gimbal is pointed for
    real, since the view depends on it. A person holds the drone at flight height and watches the
    decisions of the mission.
    """

    referee = None  # there is no truth about a pretended flight
    stills = None  # a photograph would be a command
    _now = _Pretence()

    def connect(self) -> None:
        """Connect the inner drone; nothing was pretended yet."""
        self._now = _Pretence()
        self._drone.connect()

    def observe(self) -> Observation:
        """Return the drone's observation, at the pretended height."""
        seen = self._drone.observe()
        self._pass_time(self.clock.now())
        velocity, now = seen.state.velocity, self._now
        state = replace(
            self._raised(seen.state),
            velocity=replace(velocity, down_mps=velocity.down_mps - now.climb_mps),
            flying=now.flying,
            movement=now.status,
        )
        return Observation(frame=seen.frame and self._raised(seen.frame), state=state)

    def send(self, command: Command) -> Command:
        """Pretend to obey; point the camera. Return the command as it would be sent."""
        self._obey(command.movement, self.clock.now())
        if command.gimbal is None:
            return command
        sent = self._drone.send(Command(movement=Release(), gimbal=command.gimbal))
        return replace(command, gimbal=sent.gimbal)

    def _raised(self, seen: Seen) -> Seen:
        names = ("altitude_m", "height_m", "height_above_ground_m")
        return replace(seen, **{one: getattr(seen, one) + self._now.altitude_m for one in names})

    def _pass_time(self, now_s: float) -> None:
        now = self._now
        step_s = 0.0 if now.last_s is None else now_s - now.last_s
        height_m = max(0.0, now.altitude_m + step_s * now.climb_mps)
        self._now = now = replace(now, last_s=now_s, altitude_m=height_m)
        if now_s < now.until_s:
            return
        rest = replace(now, until_s=math.inf, flying=FlyingState.HOVERING)
        if now.flying is FlyingState.TAKING_OFF:
            self._now = replace(rest, altitude_m=_TAKE_OFF_M)
        elif now.flying is FlyingState.LANDING:
            self._now = replace(rest, flying=FlyingState.LANDED, altitude_m=0.0)
        elif now.move is not None:
            height_m = max(0.0, now.altitude_m - now.move.down_m)
            done = MovementStatus(id=now.move.id, state=MovementState.DONE)
            self._now = replace(rest, altitude_m=height_m, move=None, status=done)

    def _obey(self, movement: Movement, now_s: float) -> None:
        now = self._now
        if isinstance(movement, CutMotors):
            self._begin(FlyingState.LANDED, altitude_m=0.0)
        elif now.flying is FlyingState.LANDED and isinstance(movement, TakeOff):
            self._begin(FlyingState.TAKING_OFF, until_s=now_s + _TAKE_OFF_S)
        elif now.flying not in _FLIES:
            return
        elif isinstance(movement, Land):
            self._begin(FlyingState.LANDING, until_s=now_s + _LANDING_S)
        elif isinstance(movement, Velocity):
            self._begin(FlyingState.FLYING, climb_mps=-movement.down_mps)
        elif isinstance(movement, Hover | Release):
            self._begin(FlyingState.HOVERING)
        elif isinstance(movement, MoveBy) and (now.status is None or now.status.id != movement.id):
            length_m = math.hypot(movement.forward_m, movement.right_m, movement.down_m)
            self._begin(
                FlyingState.FLYING,
                until_s=now_s + length_m / _PACE_MPS + abs(movement.yaw_rad) / _PACE_RADPS,
                move=movement,
                status=MovementStatus(id=movement.id, state=MovementState.RUNNING),
            )

    def _begin(self, flying: FlyingState, **changes: Any) -> None:
        """Begin something else: the movement that was under way is interrupted."""
        now = self._now
        status = now.status
        if now.move is not None:
            status = MovementStatus(id=now.move.id, state=MovementState.INTERRUPTED)
        changes = {"until_s": math.inf, "climb_mps": 0.0, "move": None, "status": status, **changes}
        self._now = replace(now, flying=flying, **changes)
