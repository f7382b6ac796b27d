"""A whole loopback ANAFI: twin, firmware, command link and video."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field, replace
from functools import partial

from sim_bridge.loopback.firmware.anafi import Anafi
from sim_bridge.loopback.firmware.remote_control import RemoteControl
from sim_bridge.loopback.firmware.telemetry_events import BatteryOptions
from sim_bridge.loopback.handshake import SKYCONTROLLER, Ports
from sim_bridge.loopback.media import Card, MediaStore, Photographer
from sim_bridge.loopback.messages import message_table
from sim_bridge.loopback.server import LoopbackServer, ServerOptions
from sim_bridge.loopback.streamer import VideoStats
from sim_bridge.loopback.twin_camera import TwinCamera
from sim_bridge.loopback.twin_world import TwinWorld
from sim_bridge.loopback.video import DIRECT_MEDIUM, REMOTE_MEDIUM, VideoServer
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import Scene
from uav_bt.clock import WallClock


@dataclass(frozen=True, kw_only=True)
class DroneSetup:
    """Configuration of a loopback ANAFI."""

    scene: Scene | None = None  # None: the open field
    profile: Profile = field(default_factory=Profile)
    seed: int = 0  # random seed, 0 or more
    server: ServerOptions = field(default_factory=ServerOptions)
    battery: BatteryOptions = field(default_factory=BatteryOptions)
    image_size_px: tuple[int, int] = (640, 360)  # 16:9; two cores sustain it beside a mission
    video_rate_hz: float = 30.0  # highest frame rate, that of the ANAFI
    video: bool = True
    skycontroller: bool = False  # whether clients connect to a remote control with a drone
    card: Card = Card.READY  # the memory card of the camera
    gps: bool | None = None  # whether there is a GPS fix; None: outdoors yes, in a lab no


class LoopbackDrone:
    """One drone on the network: `start`, `wait`, `close`. `start` binds the ports.

    Args:
        setup: world, firmware, server and video.

    Raises:
        MissingDependencyError: MuJoCo or OpenGL does not work here.
        ValueRangeError: the video's size is not 16:9.
    """

    def __init__(self, setup: DroneSetup) -> None:
        self._setup = setup
        gps = setup.scene is None if setup.gps is None else setup.gps
        self._clock = WallClock()
        self.world = TwinWorld(
            setup.scene, profile=setup.profile, seed=setup.seed, clock=self._clock
        )
        table, media = message_table(), MediaStore(card=setup.card)
        make_camera = partial(
            TwinCamera,
            self.world,
            image_size_px=setup.image_size_px,
            seed=setup.seed,
            clock=self._clock,
            battery=self._charge,
            zoom=self._zoom,
            gps=gps,
        )
        self._camera, stills = make_camera(), make_camera()
        self._photographer = Photographer(stills.newest, stills.close)
        self._anafi = Anafi(
            self.world,
            table,
            identity=setup.server.identity,
            battery=setup.battery,
            gps=gps,
            shoot=self._photographer.shoot,
            media=media,
        )
        drone = setup.server.identity
        if setup.skycontroller:
            remote = RemoteControl(
                self._anafi, self.world, table, drone=drone, identity=SKYCONTROLLER
            )
            options = replace(setup.server, identity=SKYCONTROLLER)
            self._server = LoopbackServer(remote, table, options, media=media)
        else:
            self._server = LoopbackServer(self._anafi, table, setup.server, media=media)
        self._video: VideoServer | None = None

    @property
    def ports(self) -> Ports:
        """The ports that are bound."""
        ports = self._server.ports
        return ports if self._video is None else replace(ports, rtsp=self._video.port)

    def video_stats(self) -> VideoStats | None:
        """Return the statistics of the video; None without a video."""
        return None if self._video is None else self._video.streamer.stats()

    def _charge(self) -> float:
        return self._anafi.battery.charge

    def _zoom(self) -> float:
        return self._anafi.zoom.level

    async def start(self) -> None:
        """Bind the ports and start the simulation.

        Raises:
            PortTakenError: a port is taken or may not be used.
            MissingDependencyError: the H.264 encoder is missing.
        """
        setup = self._setup
        try:
            if setup.video:
                self._video = VideoServer(
                    self._camera.newest,
                    size_px=setup.image_size_px,
                    rate_hz=setup.video_rate_hz,
                    serial=setup.server.identity.serial,
                    media_name=REMOTE_MEDIUM if setup.skycontroller else DIRECT_MEDIUM,
                    now=self._clock.now,
                    finish=self._camera.close,
                )
                await self._video.start(setup.server.address, setup.server.ports.rtsp)
            self.world.start()
            await self._server.start()
        except BaseException:
            await self.close()
            raise

    async def wait(self) -> None:
        """Serve until the simulation or the video fails.

        Raises:
            DroneError: the simulation or the video failed.
        """
        await self._server.wait()

    async def close(self) -> None:
        """Disconnect and stop; safe to call twice."""
        await self._server.close()
        if self._video is not None:
            await self._video.close()
        await asyncio.to_thread(self._photographer.close)
        self.world.stop()
