"""One connection through the SDK: commands out, events and frames in."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, Final

from sim_bridge.olympe import settings
from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.olympe.sdk import Sdk
from sim_bridge.olympe.settings import BorrowedSettings
from sim_bridge.olympe.speed import Sticks
from sim_bridge.olympe.video import DecodedFrame, decode_frame
from uav_bt.errors import DroneError
from uav_bt.types import MoveBy

_LOG: Final = logging.getLogger(__name__)


class OlympeLink:
    """Talks to one drone, from `open` to `close`; a new connection needs a new link.

    Args:
        sdk: the SDK.
        config: where the drone is.
        on_event: called with each event's full name and arguments, on a thread of the SDK.
        on_frame: called with each frame, on a thread of the SDK.
    """

    def __init__(
        self,
        sdk: Sdk,
        config: OlympeConfig,
        *,
        on_event: Callable[[str, Mapping[str, Any]], None],
        on_frame: Callable[[DecodedFrame], None],
    ) -> None:
        self._sdk = sdk
        self._config = config
        self._on_event = on_event
        self._on_frame = on_frame
        self._drone: Any = None
        self._steering = False
        self._settings = BorrowedSettings(self._send, config.setting_limit_s)
        # A remote control's connection to its drone; without one there is nothing to wait for.
        self._drone_there = threading.Event()
        if not config.through_skycontroller:
            self._drone_there.set()

    @property
    def connected(self) -> bool:
        """Whether the drone can be reached, as far as SDK and remote control know."""
        return self._drone is not None and self._drone.connected and self._drone_there.is_set()

    @property
    def lost(self) -> bool:
        """Whether the SDK has given the connection up; a remote control may yet find its drone."""
        return self._drone is not None and not self._drone.connected

    def open(self) -> None:
        """Connect and ask for the video; nothing about the drone changes.

        Raises:
            DroneError: the drone answers the port but not the SDK, or refuses the video.
        """
        drone = self._drone = self._sdk.drone(self._config)
        drone.subscribe(self._take_event, None)
        self._connect(drone)
        if not self._drone_there.wait(self._config.behind_limit_s):
            raise DroneError(
                f"the remote control at {self._config.host} is there, but no drone is connected to "
                "it: switch the drone on, and wait until the remote control shows that it has it"
            )
        if not self._sdk.play(drone.streaming, self._config, self._take_frame):
            raise DroneError(
                f"{self._config.where} gives no video (RTSP port {self._config.rtsp_port}) within "
                f"{self._config.video_limit_s:.0f} s: another program may hold it, or a firewall "
                "keeps UDP out"
            )

    def close(self) -> None:
        """Put the drone's settings back and disconnect; safe to call twice."""
        if self._drone is None:
            return
        if self.connected:
            self._leave()
        drone, self._drone = self._drone, None
        # The SDK waits for half a minute for drones that are gone, and 7.7.5 for ten seconds for
        # itself when it is done; the caller need not.
        done = threading.Event()
        threading.Thread(target=_disconnect, args=(drone, done), daemon=True).start()
        done.wait(self._config.close_limit_s)

    def prepare(self, *, tilt_rad: float) -> None:
        """Set the limits of a flight; `close` puts back what was set before.

        Args:
            tilt_rad: the greatest tilt.
        """
        config = self._config
        wanted: dict[settings.Setting, float | str] = {
            settings.TILT: math.degrees(tilt_rad),
            settings.ALTITUDE: config.altitude_limit_m,
            settings.CLIMB: config.climb_limit_mps,
            settings.ROTATION: math.degrees(config.yaw_rate_limit_radps),
            # A turn that rolls the drone would move it sideways in a lab.
            settings.BANKED_TURN: 0,
        }
        if config.return_home is not None:
            wanted[settings.RETURN_HOME] = "on" if config.return_home else "off"
        self._settings.change(wanted)

    def take_sticks(self) -> None:
        """Make a remote control pass our commands on in place of its sticks."""
        self._send("skyctrl.CoPiloting.setPilotingSource", source="Controller")

    def give_sticks(self) -> None:
        """Make a remote control's sticks fly the drone again."""
        self._send("skyctrl.CoPiloting.setPilotingSource", source="SkyController")

    def take_off(self) -> None:
        """Start the motors and climb."""
        self._send("ardrone3.Piloting.TakeOff")

    def land(self) -> None:
        """Descend and stop the motors."""
        self._send("ardrone3.Piloting.Landing")
        self.let_go()  # after the landing was sent: it may fail

    def cut_motors(self) -> None:
        """Stop the motors in flight."""
        self._send("ardrone3.Piloting.Emergency")

    def move(self, move: MoveBy, *, at_speed: bool) -> None:
        """Start a relative movement; it ends the one before.

        Args:
            move: the movement.
            at_speed: keep within the configuration's speeds, which older firmware cannot.
        """
        self.let_go()
        if not at_speed:
            self._send(
                "ardrone3.Piloting.moveBy",
                dX=move.forward_m,
                dY=move.right_m,
                dZ=move.down_m,
                dPsi=move.yaw_rad,
            )
            return
        self._send(
            "move.extended_move_by",
            d_x=move.forward_m,
            d_y=move.right_m,
            d_z=move.down_m,
            d_psi=move.yaw_rad,
            max_horizontal_speed=self._config.speed_limit_mps,
            max_vertical_speed=self._config.climb_limit_mps,
            max_yaw_rotation_speed=math.degrees(self._config.yaw_rate_limit_radps),
        )

    def halt(self) -> None:
        """End the movement under way: a movement by nothing replaces it, on any firmware."""
        self._send("ardrone3.Piloting.moveBy", dX=0.0, dY=0.0, dZ=0.0, dPsi=0.0)

    def steer(self, sticks: Sticks) -> None:
        """Hold these stick positions until the next ones, for `sticks_hold_s` at most."""
        self._steering = True
        drone = self._present()
        if not drone.piloting(
            sticks.roll, sticks.pitch, sticks.yaw, sticks.climb, self._config.sticks_hold_s
        ):
            raise DroneError(f"{self._config.where} does not take stick positions any more")

    def centre(self) -> None:
        """Centre the sticks, if they are held."""
        if self._steering:
            self._present().piloting(0, 0, 0, 0, 0.0)

    def let_go(self) -> None:
        """Send no more stick positions."""
        if self._steering:
            self._steering = False
            drone = self._present()
            drone.piloting(0, 0, 0, 0, 0.0)
            drone.stop_piloting()

    def point(self, pitch_rad: float) -> None:
        """Point the camera: rad from the horizon, negative down."""
        self._send(
            "gimbal.set_target",
            gimbal_id=0,
            control_mode="position",
            yaw_frame_of_reference="none",
            yaw=0.0,
            pitch_frame_of_reference="absolute",
            pitch=math.degrees(pitch_rad),
            roll_frame_of_reference="none",
            roll=0.0,
        )

    def _connect(self, drone: Any) -> None:
        """Connect.

        Raises:
            DroneError: the drone refuses, or does not get ready in time.
        """
        answers: list[bool] = []

        def connect() -> None:
            answers.append(bool(drone.connect()))

        limit_s, where = self._config.connect_limit_s, self._config.where
        start_s = time.monotonic()
        connecting = threading.Thread(target=connect, daemon=True)
        connecting.start()
        connecting.join(limit_s)
        if not answers:
            raise DroneError(
                f"{where} accepts a connection, but is not ready for commands after "
                f"{limit_s:.0f} s: restart it, and see that no other program (a FreeFlight, "
                "another uav-bt) is connected"
            )
        if not answers[0]:
            raise DroneError(
                f"{where} refused the connection after {time.monotonic() - start_s:.1f} s: see "
                "that no other program (a FreeFlight, another uav-bt) is connected; if none is, "
                "restart it"
            )

    def _leave(self) -> None:
        """Let go of sticks and settings; what the SDK does not do any more is logged."""
        try:
            self.let_go()
            self._settings.restore()
            if self._config.through_skycontroller:
                self.give_sticks()
        except Exception as error:  # noqa: BLE001  # the connection is closed in any case
            _LOG.warning("not all of the drone's settings could be put back: %s", error)

    def _send(self, name: str, **args: Any) -> Any:
        return self._present()(self._sdk.message(name)(**args))

    def _present(self) -> Any:
        if self._drone is None:
            raise DroneError("the drone is not connected: call connect() first")
        return self._drone

    def _take_event(self, event: Any, scheduler: Any) -> None:
        del scheduler
        message, args = getattr(event, "message", None), getattr(event, "args", None)
        kind = getattr(getattr(message, "message_type", None), "name", "")
        # Commands come by here as well; they carry nothing about the drone.
        if message is not None and kind == "EVT" and isinstance(args, Mapping):
            named = {key: getattr(arg, "name", arg) for key, arg in args.items()}
            self._note(message.fullName, named)
            self._on_event(message.fullName, named)

    def _note(self, name: str, args: Mapping[str, Any]) -> None:
        self._settings.take(name, args)
        if name == "drone_manager.connection_state" and self._config.through_skycontroller:
            if args["state"] == "connected":
                self._drone_there.set()
            else:
                self._drone_there.clear()

    def _take_frame(self, frame: Any) -> None:
        frame.ref()
        try:
            decoded = decode_frame(frame)
        finally:
            frame.unref()
        if decoded is not None:
            self._on_frame(decoded)


def _disconnect(drone: Any, done: threading.Event) -> None:
    try:
        if drone.connected and drone.streaming is not None:
            drone.streaming.stop()
        drone.disconnect()
    finally:
        done.set()
    drone.destroy()
