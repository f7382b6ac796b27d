"""Connection to one drone through the SDK: sends commands, receives events and frames."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

from sim_bridge.olympe import settings
from sim_bridge.olympe.commands import CommandQueue, Job
from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.olympe.orders import Orders
from sim_bridge.olympe.sdk import Sdk
from sim_bridge.olympe.settings import BorrowedSettings
from sim_bridge.olympe.video import DecodedFrame, decode_frame
from uav_bt.errors import DroneError

_LOG: Final = logging.getLogger(__name__)


class OlympeLink:
    """Connection to one drone, from `open` to `close`; a new connection needs a new link.

    The command thread makes, uses and destroys the SDK's object. `open` and `close` wait for that
    thread, with timeouts; `orders` and `prepare` must be called on it. Other threads only read
    whether the SDK is connected, an attribute that the SDK's threads set.

    Args:
        sdk: the SDK.
        config: address, limits and timeouts.
        commands: the command thread.
        now: the clock, s.
        on_event: called with full name and arguments of each event, on a thread of the SDK.
        on_frame: called with each frame, on a thread of the SDK.
    """

    def __init__(
        self,
        sdk: Sdk,
        config: OlympeConfig,
        commands: CommandQueue,
        *,
        now: Callable[[], float],
        on_event: Callable[[str, Mapping[str, Any]], None],
        on_frame: Callable[[DecodedFrame], None],
    ) -> None:
        self._sdk = sdk
        self._config = config
        self._commands = commands
        self._on_event = on_event
        self._on_frame = on_frame
        self._drone: Any = None
        self._hangs = False  # whether a call of the SDK took longer than its timeout
        self.orders: Final = Orders(sdk, config, self._present)
        self._settings = BorrowedSettings(self.orders.send, now, config.setting_limit_s)
        self._failed: set[str] = set()  # events and frames whose handling failed
        self._failing = threading.Lock()  # guards `_failed`: two threads of the SDK write to it
        # Set while a remote control is connected to its drone, and without a remote control.
        self._drone_there = threading.Event()
        if not config.through_skycontroller:
            self._drone_there.set()

    @property
    def connected(self) -> bool:
        """Whether the drone is connected, according to SDK and remote control."""
        return self._sdk_connected and self._drone_there.is_set()

    @property
    def lost(self) -> bool:
        """Whether the SDK has dropped the connection; a remote control may still find its drone."""
        return self._drone is not None and not self._sdk_connected

    @property
    def _sdk_connected(self) -> bool:
        drone = self._drone
        return drone is not None and bool(drone.connected)

    def open(self) -> None:
        """Connect and request the video; the drone's settings do not change.

        Raises:
            DroneError: the port answers but not the SDK's requests, or the video is refused.
            InputError: the installed SDK cannot use the ports of the configuration.
        """
        try:
            self._open()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Restore the drone's settings and disconnect, after the waiting commands.

        An SDK that exceeds the timeouts of the configuration finishes in the background.
        """
        if self._hangs:
            self._commands.close(self._leave, self._destroy)
            return
        config = self._config
        limit_s = config.close_limit_s
        if self.connected:  # otherwise no command is answered, and settings cannot be restored
            limit_s += config.command_limit_s + config.setting_limit_s
        try:
            if not self._commands.run(self._leave, limit_s):
                _LOG.warning(
                    "the SDK has not disconnected from %s within %g s: the last commands may not "
                    "have reached the drone, and its settings may not be restored",
                    config.where,
                    limit_s,
                )
        finally:
            # This takes 30 s for lost drones, and with SDK 7.7.5 always 10 s.
            self._commands.close(self._destroy)

    def web_address(self) -> tuple[str, int]:
        """Return host and port of the drone's web server.

        Raises:
            DroneError: not connected.
        """
        return self._sdk.web_address(self._present(), self._config)

    def check_settings(self) -> None:
        """Warn once about limits that the drone has not confirmed in time."""
        self._settings.check()

    def prepare(self, *, tilt_rad: float) -> None:
        """Set the limits of a flight without waiting; `close` restores the former values.

        Args:
            tilt_rad: the largest tilt.
        """
        self._settings.change(self._limits(tilt_rad))

    def _limits(self, tilt_rad: float) -> Mapping[settings.Setting, float | str]:
        config = self._config
        limits: dict[settings.Setting, float | str] = {
            settings.TILT: math.degrees(tilt_rad),
            settings.ALTITUDE: config.altitude_limit_m,
            settings.CLIMB: config.climb_limit_mps,
            settings.ROTATION: math.degrees(config.yaw_rate_limit_radps),
            # A banked turn would move the drone sideways.
            settings.BANKED_TURN: 0,
        }
        if config.return_home is not None:
            limits[settings.RETURN_HOME] = "on" if config.return_home else "off"
        return limits

    def _open(self) -> None:
        config = self._config
        self._finish(
            self._connect,
            config.connect_limit_s,
            late=f"{config.where} accepts a connection, but is not ready for commands after "
            f"{config.connect_limit_s:.0f} s: restart it, and check that no other program (a "
            "FreeFlight, another uav-bt) is connected",
        )
        if not self._drone_there.wait(config.behind_limit_s):
            raise DroneError(
                f"the remote control at {config.host} is there, but no drone is connected to it: "
                "switch the drone on, and wait until the remote control shows the connection"
            )
        # The SDK keeps the timeout itself; a call that takes twice as long hangs.
        self._finish(self._play, 2.0 * config.video_limit_s, late=self._no_video)
        self._settings.await_reports(self._limits(config.tilt_limit_rad))

    def _finish(self, job: Job, limit_s: float, *, late: str) -> None:
        """Run a job on the command thread.

        Raises:
            DroneError: the job does not end in time.
        """
        self._hangs = True  # also if the wait is interrupted
        try:
            self._hangs = not self._commands.run(job, limit_s)
        except Exception:
            self._hangs = False  # the job has ended with an error
            raise
        if self._hangs:
            raise DroneError(late)

    def _connect(self) -> None:
        """Make the SDK's object and connect it.

        Raises:
            DroneError: the drone refuses the connection.
        """
        start_s = time.monotonic()
        drone = self._drone = self._sdk.drone(self._config)
        drone.subscribe(self._take_event, None)
        if not drone.connect():
            raise DroneError(
                f"{self._config.where} refused the connection after "
                f"{time.monotonic() - start_s:.1f} s: check that no other program (a FreeFlight, "
                "another uav-bt) is connected; if none is, restart it"
            )

    def _play(self) -> None:
        if not self._sdk.play(self._present().streaming, self._config, self._take_frame):
            raise DroneError(self._no_video)

    @property
    def _no_video(self) -> str:
        config = self._config
        return (
            f"{config.where} sends no video (RTSP port {config.rtsp_port}) within "
            f"{config.video_limit_s:.0f} s: another program may use it, or a firewall blocks "
            "UDP"
        )

    def _leave(self) -> None:
        """Release sticks and settings and disconnect; a failed step does not stop the next ones."""
        drone = self._drone
        if drone is None:
            return
        if self.connected:
            _attempt("releasing the sticks", self.orders.let_go)
            _attempt("restoring the drone's settings", self._settings.restore)
        else:
            self._settings.give_up()
        if self._sdk_connected:
            if self._config.through_skycontroller:
                _attempt("giving the sticks back", self.orders.give_sticks)
            if drone.streaming is not None:
                _attempt("stopping the video", drone.streaming.stop)
        _attempt("disconnecting", drone.disconnect)

    def _destroy(self) -> None:
        drone, self._drone = self._drone, None
        if drone is not None:
            drone.destroy()

    def _present(self) -> Any:
        if self._drone is None:
            raise DroneError("the drone is not connected: call connect() first")
        return self._drone

    def _take_event(self, event: Any, scheduler: Any) -> None:
        del scheduler
        message, args = getattr(event, "message", None), getattr(event, "args", None)
        kind = getattr(getattr(message, "message_type", None), "name", "")
        # Commands arrive here as well; they contain no data about the drone.
        if message is not None and kind == "EVT" and isinstance(args, Mapping):
            named = {key: getattr(arg, "name", arg) for key, arg in args.items()}
            with self._complaining(f"its event {message.fullName}"):
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
        with self._complaining("its video frames"):
            frame.ref()
            try:
                decoded = decode_frame(frame)
            finally:
                frame.unref()
            if decoded is not None:
                self._on_frame(decoded)

    @contextmanager
    def _complaining(self, what: str) -> Iterator[None]:
        """Log the first failure of each event or frame type, because the SDK would hide it."""
        try:
            yield
        except Exception:
            with self._failing:
                known = what in self._failed
                self._failed.add(what)
            if not known:
                _LOG.exception("the drone's data cannot be used: %s", what)
            raise


def _attempt(what: str, action: Callable[[], object]) -> None:
    try:
        action()
    except BaseException as error:  # noqa: BLE001  # includes the SDK's cancellations
        _LOG.warning("%s failed: %s: %s", what, type(error).__name__, error)
