"""One connection through the SDK: commands out, events and frames in."""

from __future__ import annotations

import logging
import math
import socket
import threading
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

from sim_bridge.olympe.config import SKYCONTROLLER_HOST, OlympeConfig
from sim_bridge.olympe.sdk import Sdk
from sim_bridge.olympe.speed import Sticks
from sim_bridge.olympe.video import DecodedFrame, frame_metadata
from uav_bt.errors import DroneError
from uav_bt.types import MoveBy

_LOG: Final = logging.getLogger(__name__)

_HINTS: Final = {
    "anafi": (
        "switch the drone on, join its Wi-Fi (or plug the SkyController in and use "
        f"anafi:{SKYCONTROLLER_HOST}), and try again"
    ),
    "sphinx": "start Sphinx and its drone, and try again",
}


def probe(config: OlympeConfig) -> None:
    """Check that a drone listens at the address; the SDK alone would wait for 45 s.

    Raises:
        DroneError: none does, within the time that the configuration gives.
    """
    try:
        socket.create_connection(
            (config.host, config.discovery_port), timeout=config.probe_limit_s
        ).close()
    except TimeoutError as error:
        raise DroneError(
            f"no answer from {config.where} within {config.probe_limit_s:.0f} s: "
            f"{_HINTS[config.kind]}"
        ) from error
    except socket.gaierror as error:
        raise DroneError(f"the host '{config.host}' is unknown: check its spelling") from error
    except OSError as error:
        raise DroneError(
            f"cannot reach {config.where} ({error.strerror or error}): {_HINTS[config.kind]}"
        ) from error


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
        """Disconnect; safe to call twice."""
        drone, self._drone = self._drone, None
        if drone is None:
            return
        if self._steering:
            drone.stop_piloting()
        # The SDK waits for half a minute for drones that are gone, and 7.7.5 for ten seconds for
        # itself when it is done; the caller need not.
        done = threading.Event()
        threading.Thread(target=_disconnect, args=(drone, done), daemon=True).start()
        done.wait(self._config.close_limit_s)

    def take_off(self) -> None:
        """Start the motors and climb."""
        self._send("ardrone3.Piloting.TakeOff")

    def land(self) -> None:
        """Descend and stop the motors."""
        self._send("ardrone3.Piloting.Landing")

    def cut_motors(self) -> None:
        """Stop the motors in flight."""
        self._send("ardrone3.Piloting.Emergency")

    def move(self, move: MoveBy) -> None:
        """Start a relative movement; it ends the one before."""
        self.let_go()
        self._send(
            "ardrone3.Piloting.moveBy",
            dX=move.forward_m,
            dY=move.right_m,
            dZ=move.down_m,
            dPsi=move.yaw_rad,
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
            # The SkyController then passes these commands on instead of its sticks.
            self._send("skyctrl.CoPiloting.setPilotingSource", source="Controller")
        limits = {
            "ardrone3.PilotingSettings.MaxTilt": math.degrees(config.tilt_limit_rad),
            "ardrone3.PilotingSettings.MaxAltitude": config.altitude_limit_m,
            "ardrone3.SpeedSettings.MaxVerticalSpeed": config.climb_limit_mps,
            "ardrone3.SpeedSettings.MaxRotationSpeed": math.degrees(config.yaw_rate_limit_radps),
        }
        asked = {name: self._send(name, current=limit) for name, limit in limits.items()}
        # A turn that rolls the drone would move it sideways in a lab; not all firmware knows it.
        self._send("ardrone3.PilotingSettings.BankedTurn", value=0)
        for name, answer in asked.items():
            answer.wait(_timeout=self._config.setting_limit_s)
            if not answer.success():
                _LOG.warning("the drone does not confirm %s = %s", name, limits[name])

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
            self._on_event(
                message.fullName, {key: getattr(arg, "name", arg) for key, arg in args.items()}
            )

    def _take_frame(self, frame: Any) -> None:
        frame.ref()
        try:
            decoded = _decoded(frame)
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


def _decoded(frame: Any) -> DecodedFrame | None:
    """Return a copy of the SDK's frame, None where it has no content."""
    info, planes = frame.info(), frame.as_ndarray()
    if not info or planes is None:
        return None
    raw = info["raw"]["frame"]
    details = raw["info"]
    return DecodedFrame(
        planes=np.array(planes),
        layout="nv12" if "SEMI_PLANAR" in raw.get("format", "") else "yuv420p",
        full_range=bool(details.get("full_range", False)),
        bt601=str(details.get("matrix_coefs", "")).startswith("BT601"),
        metadata=frame_metadata(frame.vmeta()[1]),
        streamed_us=int(info.get("ntp_raw_timestamp", 0)) or None,
    )
