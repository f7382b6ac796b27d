"""Connection to one drone through the SDK: sends commands, receives events and frames."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, Final

from sim_bridge.olympe import orders
from sim_bridge.olympe import settings as drone_settings
from sim_bridge.olympe.commands import CommandQueue, Job
from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.olympe.orders import Order
from sim_bridge.olympe.sdk import VIDEO_LIMIT_S, Sdk
from sim_bridge.olympe.settings import BorrowedSettings
from sim_bridge.olympe.speed import Sticks
from sim_bridge.olympe.stills import OlympeStills
from sim_bridge.olympe.telemetry import Telemetry
from sim_bridge.olympe.video import FrameClock, NewestFrame, decode_frame
from uav_bt.errors import DroneError
from uav_bt.types import Observation

_LOG: Final = logging.getLogger(__name__)

CONNECT_LIMIT_S: Final = 10.0  # chosen: it usually takes two or three, and the SDK waits for 45
BEHIND_LIMIT_S: Final = 5.0  # of a remote control's report of its drone; chosen
COMMANDS_LIMIT_S: Final = 3.0  # of the queued commands at the end; chosen: one may block for 2 s
CLOSE_LIMIT_S: Final = 5.0  # of the SDK's disconnection: at most 1 s with a drone that answers
# Time for which the SDK repeats stick positions, every 25 ms, before it centres them. Chosen: a
# drone whose mission hangs flies at most half a metre.
_STICKS_HOLD_S: Final = 0.5


class OlympeLink:
    """Connection to one drone, from `open` to `close`; a new connection needs a new link.

    The command thread makes, uses and destroys the SDK's object. `open` and `close` wait for that
    thread, with timeouts; what sends commands or sticks must be called on it. Other threads only
    read whether the SDK is connected, an attribute that the SDK's threads set.
    """

    def __init__(
        self,
        sdk: Sdk,
        config: OlympeConfig,
        commands: CommandQueue,
        clock: FrameClock,
        *,
        remote: bool,
    ) -> None:
        self._sdk = sdk
        self._config = config
        self.commands = commands
        self._remote = remote  # whether a remote control answers at the address
        self._drone: Any = None
        self._plays = False  # whether the drone has accepted the request for the video
        self._steering = False  # whether the SDK sends stick positions
        self.settings: Final = BorrowedSettings(config, self.send, clock.now)
        self.telemetry: Final = Telemetry(config, clock.now)
        self.stills: Final = OlympeStills(self.send, commands, self.web_address)
        self._frames = NewestFrame(config, clock)
        self._failed: set[str] = set()  # events and frames whose handling failed
        # Set while a remote control is connected to its drone, and without a remote control.
        self._drone_there = threading.Event()
        if not remote:
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

    def observe(self) -> Observation:
        """Return the newest frame and state, and send what settings and photographs need next."""
        self.settings.check()
        self.stills.advance()
        state = replace(self.telemetry.state(), connected=self.connected, lost=self.lost)
        return Observation(frame=self._frames.newest(state), state=state)

    def open(self) -> None:
        """Connect and request the video; the drone's settings do not change."""
        try:
            self._open()
        except BaseException:
            self.close()
            raise

    def _open(self) -> None:
        where = self._config.where
        if not self.commands.run(self._connect, CONNECT_LIMIT_S):
            raise DroneError(
                f"{where} accepts a connection, but is not ready for commands after "
                f"{CONNECT_LIMIT_S:.0f} s: restart it, and check that no other program (a "
                "FreeFlight, another uav-bt) is connected"
            )
        if not self._drone_there.wait(BEHIND_LIMIT_S):
            raise DroneError(
                f"the remote control at {self._config.host} is there, but no drone is connected "
                "to it: switch the drone on, and wait until the remote control shows the connection"
            )
        # The SDK keeps the timeout itself; a call that takes twice as long hangs.
        if not self.commands.run(self._play, 2.0 * VIDEO_LIMIT_S) or not self._plays:
            raise DroneError(
                f"{where} sends no video (RTSP port {self._config.rtsp_port}) within "
                f"{VIDEO_LIMIT_S:.0f} s: another program may use it, or a firewall blocks UDP"
            )
        self.settings.await_reports()

    def close(self) -> None:
        """Restore the drone's settings and disconnect, after the waiting commands.

        An SDK that exceeds the timeouts finishes in the background.
        """
        if self.commands.hangs:
            self.commands.close(self._leave, self._destroy)
            return
        limit_s = CLOSE_LIMIT_S
        if self.connected:  # otherwise no command is answered, and settings cannot be restored
            limit_s += COMMANDS_LIMIT_S + drone_settings.LIMIT_S
        try:
            if not self.commands.run(self._leave, limit_s):
                _LOG.warning(
                    "the SDK has not disconnected from %s within %g s: the last commands may not "
                    "have reached the drone, and its settings may not be restored",
                    self._config.where,
                    limit_s,
                )
        finally:
            # This takes 30 s for lost drones, and with SDK 7.7.5 always 10 s.
            self.commands.close(self._destroy)

    def web_address(self) -> tuple[str, int]:
        """Return host and port of the drone's web server."""
        return self._sdk.web_address(self._present(), self._config, remote=self._remote)

    def send(self, order: Order) -> None:
        """Send a command."""
        self._present()(self._sdk.message(order.name)(**order.args))

    def land(self) -> None:
        """Descend and stop the motors."""
        self.send(orders.LANDING)
        self.let_go()  # after the landing, because it may fail

    def move(self, order: Order) -> None:
        """Start a relative movement."""
        self.let_go()
        self.send(order)

    def steer(self, sticks: Sticks) -> None:
        """Hold stick positions until the next ones, for at most half a second."""
        self._steering = True
        if not self._present().piloting(*sticks, _STICKS_HOLD_S):
            raise DroneError(f"{self._config.where} no longer accepts stick positions")

    def centre(self) -> None:
        """Centre the sticks, if they are held."""
        if self._steering:
            self._present().piloting(0, 0, 0, 0, 0.0)

    def let_go(self) -> None:
        """Stop sending stick positions."""
        if self._steering:
            self._steering = False
            drone = self._present()
            drone.piloting(0, 0, 0, 0, 0.0)
            drone.stop_piloting()

    def _present(self) -> Any:
        if self._drone is None:
            raise DroneError("the drone is not connected: call connect() first")
        return self._drone

    def _connect(self) -> None:
        """Make the SDK's object and connect it."""
        start_s = time.monotonic()
        drone = self._drone = self._sdk.drone(self._config, remote=self._remote)
        drone.subscribe(self._take_event, None)
        if not drone.connect():
            raise DroneError(
                f"{self._config.where} refused the connection after "
                f"{time.monotonic() - start_s:.1f} s: check that no other program (a FreeFlight, "
                "another uav-bt) is connected; if none is, restart it"
            )

    def _play(self) -> None:
        play, remote = self._sdk.play, self._remote
        self._plays = play(self._present(), self._config, self._take_frame, remote=remote)

    def _leave(self) -> None:
        """Release sticks and settings and disconnect; a failed step does not stop the next ones."""
        drone = self._drone
        if drone is None:
            return
        there = self.connected
        if there:
            _attempt("releasing the sticks", self.let_go)
        restore = self.settings.restore
        _attempt("restoring the drone's settings", lambda: restore(connected=there))
        if self._sdk_connected:
            if self._remote:
                _attempt("giving the sticks back", lambda: self.send(orders.GIVE_STICKS))
            if drone.streaming is not None:
                _attempt("stopping the video", drone.streaming.stop)
        _attempt("disconnecting", drone.disconnect)

    def _destroy(self) -> None:
        drone, self._drone = self._drone, None
        if drone is not None:
            drone.destroy()

    def _take_event(self, event: Any, _scheduler: Any) -> None:
        message, args = getattr(event, "message", None), getattr(event, "args", None)
        kind = getattr(getattr(message, "message_type", None), "name", "")
        # Commands arrive here as well; they contain no data about the drone.
        if message is None or kind != "EVT" or not isinstance(args, Mapping):
            return
        name = message.fullName
        named = {key: getattr(arg, "name", arg) for key, arg in args.items()}
        with self._complaining(f"its event {name}"):
            self.settings.take(name, named)
            if self._remote and name == "drone_manager.connection_state":
                if named["state"] == "connected":
                    self._drone_there.set()
                else:
                    self._drone_there.clear()
            self.telemetry.take(name, named)
            self.stills.take(name, named)

    def _take_frame(self, frame: Any) -> None:
        with self._complaining("its video frames"):
            frame.ref()
            try:
                decoded = decode_frame(frame)
            finally:
                frame.unref()
            if decoded is not None:
                self._frames.take(decoded)

    @contextmanager
    def _complaining(self, what: str) -> Iterator[None]:
        """Log the first failure of each event or frame type, because the SDK would hide it."""
        try:
            yield
        except Exception:
            if what not in self._failed:
                self._failed.add(what)
                _LOG.exception("the drone's data cannot be used: %s", what)
            raise


def _attempt(what: str, action: Job) -> None:
    try:
        action()
    except BaseException as error:  # noqa: BLE001  # includes the SDK's cancellations
        _LOG.warning("%s failed: %s: %s", what, type(error).__name__, error)
