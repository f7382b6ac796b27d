"""One connection through the SDK: commands in our words, events and frames handed on."""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.olympe.metadata import frame_metadata
from sim_bridge.olympe.sdk import Sdk
from sim_bridge.olympe.speed import Sticks
from sim_bridge.olympe.video import Picture
from uav_bt.errors import DroneError
from uav_bt.types import MoveBy

__all__ = ["OlympeLink"]

_LOG: Final = logging.getLogger(__name__)

_SETTING_LIMIT_S: Final = 2.0  # for the drone to confirm a setting; it takes milliseconds
# The SDK repeats stick positions every 25 ms for so long, then centres them: a mission that hangs
# hovers.
_STICKS_HOLD_S: Final = 0.5


class OlympeLink:
    """Talks to one drone, from `open` to `close`; a new connection needs a new link.

    Args:
        sdk: the SDK.
        config: where the drone is.
        on_event: given each event's full name and arguments, on a thread of the SDK.
        on_picture: given each picture, on a thread of the SDK.
    """

    def __init__(
        self,
        sdk: Sdk,
        config: OlympeConfig,
        *,
        on_event: Callable[[str, Mapping[str, Any]], None],
        on_picture: Callable[[Picture], None],
    ) -> None:
        self._sdk = sdk
        self._config = config
        self._on_event = on_event
        self._on_picture = on_picture
        self._drone: Any = None
        self._steering = False

    def open(self) -> None:
        """Connect, set the drone up, and ask for the video.

        Raises:
            DroneError: the drone answers the port but not the SDK, or refuses the video.
        """
        drone = self._drone = self._sdk.drone(self._config)
        drone.subscribe(self._take_event, None)
        if not self._connected_in_time(drone):
            raise DroneError(
                f"{self._config.where} accepts a connection, but is not ready for commands after "
                f"{self._config.connect_limit_s:.0f} s: restart it, and see that no other program "
                "(a FreeFlight, another uav-bt) is connected"
            )
        self._set_up()
        if not self._sdk.play(drone.streaming, self._config, self._take_frame):
            raise DroneError(
                f"{self._config.where} gives no video (RTSP port {self._config.rtsp_port}) within "
                f"{self._config.video_limit_s:.0f} s: another program may hold it, or a firewall "
                "keeps UDP out"
            )

    def close(self) -> None:
        """Let go of the drone; safe to call twice."""
        drone, self._drone = self._drone, None
        if drone is None:
            return
        if self._steering:
            drone.stop_piloting()
        # The SDK waits for half a minute for drones that are gone, and 7.7.5 for ten seconds for
        # itself when it is done; nobody else need do so.
        left = threading.Event()
        threading.Thread(target=_leave, args=(drone, left), daemon=True).start()
        left.wait(self._config.close_limit_s)

    @property
    def connected(self) -> bool:
        """Whether the SDK believes that the drone is there."""
        return self._drone is not None and bool(self._drone.connected)

    def take_off(self) -> None:
        """Start the motors and climb."""
        self._tell("ardrone3.Piloting.TakeOff")

    def land(self) -> None:
        """Descend and stop the motors."""
        self._tell("ardrone3.Piloting.Landing")

    def cut_motors(self) -> None:
        """Stop the motors in flight."""
        self._tell("ardrone3.Piloting.Emergency")

    def move(self, move: MoveBy) -> None:
        """Start a relative movement; it ends the one before."""
        self.let_go()
        self._tell(
            "ardrone3.Piloting.moveBy",
            dX=move.forward_m,
            dY=move.right_m,
            dZ=move.down_m,
            dPsi=move.yaw_rad,
        )

    def halt(self) -> None:
        """End the movement under way: a movement by nothing replaces it, on any firmware."""
        self._tell("ardrone3.Piloting.moveBy", dX=0.0, dY=0.0, dZ=0.0, dPsi=0.0)

    def steer(self, sticks: Sticks) -> None:
        """Hold the sticks so, until told otherwise and for half a second at most."""
        self._steering = True
        drone = self._present()
        if not drone.piloting(sticks.roll, sticks.pitch, sticks.yaw, sticks.climb, _STICKS_HOLD_S):
            raise DroneError(f"{self._config.where} does not take stick positions any more")

    def centre(self) -> None:
        """Centre the sticks, if they are held."""
        if self._steering:
            self._present().piloting(0, 0, 0, 0, 0.0)

    def let_go(self) -> None:
        """Send no stick positions any more."""
        if self._steering:
            self._steering = False
            drone = self._present()
            drone.piloting(0, 0, 0, 0, 0.0)
            drone.stop_piloting()

    def point(self, pitch_rad: float) -> None:
        """Point the camera, against the horizon."""
        self._tell(
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

    def take_piloting(self) -> None:
        """Ask the SkyController to pass our commands on instead of its sticks."""
        self._tell("skyctrl.CoPiloting.setPilotingSource", source="Controller")

    def _connected_in_time(self, drone: Any) -> bool:
        answers: list[bool] = []

        def connect() -> None:
            answers.append(bool(drone.connect()))

        connecting = threading.Thread(target=connect, daemon=True)
        connecting.start()
        connecting.join(self._config.connect_limit_s)
        return bool(answers) and answers[0]

    def _set_up(self) -> None:
        config = self._config
        if config.through_skycontroller:
            self.take_piloting()
        limits = {
            "ardrone3.PilotingSettings.MaxTilt": math.degrees(config.tilt_limit_rad),
            "ardrone3.PilotingSettings.MaxAltitude": config.altitude_limit_m,
            "ardrone3.SpeedSettings.MaxVerticalSpeed": config.climb_limit_mps,
            "ardrone3.SpeedSettings.MaxRotationSpeed": math.degrees(config.yaw_rate_limit_radps),
        }
        asked = {name: self._tell(name, current=limit) for name, limit in limits.items()}
        # A turn that rolls the drone would move it sideways in a lab; not all firmware knows it.
        self._tell("ardrone3.PilotingSettings.BankedTurn", value=0)
        for name, answer in asked.items():
            answer.wait(_timeout=_SETTING_LIMIT_S)
            if not answer.success():
                _LOG.warning("the drone does not confirm %s = %s", name, limits[name])

    def _tell(self, name: str, **args: Any) -> Any:
        return self._present()(self._sdk.message(name)(**args))

    def _present(self) -> Any:
        if self._drone is None:
            raise DroneError("the drone is not connected: call connect() first")
        return self._drone

    def _take_event(self, event: Any, scheduler: Any) -> None:
        del scheduler
        message, args = getattr(event, "message", None), getattr(event, "args", None)
        kind = getattr(getattr(message, "message_type", None), "name", "")
        # What we sent comes by here as well, and says nothing about the drone.
        if message is not None and kind == "EVT" and isinstance(args, Mapping):
            self._on_event(
                message.fullName, {key: getattr(arg, "name", arg) for key, arg in args.items()}
            )

    def _take_frame(self, frame: Any) -> None:
        frame.ref()
        try:
            picture = _picture(frame)
        finally:
            frame.unref()
        if picture is not None:
            self._on_picture(picture)


def _leave(drone: Any, left: threading.Event) -> None:
    try:
        if drone.connected and drone.streaming is not None:
            drone.streaming.stop()
        drone.disconnect()
    finally:
        left.set()
    drone.destroy()


def _picture(frame: Any) -> Picture | None:
    """Return a copy of the SDK's frame, None where it has no content."""
    info, planes = frame.info(), frame.as_ndarray()
    if not info or planes is None:
        return None
    raw = info["raw"]["frame"]
    details = raw["info"]
    return Picture(
        planes=np.array(planes),
        layout="nv12" if "SEMI_PLANAR" in raw.get("format", "") else "yuv420p",
        full_range=bool(details.get("full_range", False)),
        bt601=str(details.get("matrix_coefs", "")).startswith("BT601"),
        metadata=frame_metadata(frame.vmeta()[1]),
        streamed_us=int(info.get("ntp_raw_timestamp", 0)) or None,
    )
