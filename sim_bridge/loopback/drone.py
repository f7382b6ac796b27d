"""A whole loopback ANAFI: twin, firmware, command link and video."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

from sim_bridge.loopback.firmware.anafi import Anafi
from sim_bridge.loopback.firmware.remote_control import RemoteControl
from sim_bridge.loopback.handshake import Identity, Ports
from sim_bridge.loopback.media import Card, MediaStore
from sim_bridge.loopback.photographer import Photographer
from sim_bridge.loopback.server import LoopbackServer
from sim_bridge.loopback.twin_camera import TwinCamera
from sim_bridge.loopback.twin_world import TwinWorld
from sim_bridge.loopback.video.dialogue import DIRECT_MEDIUM, REMOTE_MEDIUM
from sim_bridge.loopback.video.encoder import EncoderConfig
from sim_bridge.loopback.video.server import VideoServer, serve_video
from sim_bridge.loopback.video.streamer import VideoStats
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import Scene
from uav_bt.clock import WallClock
from uav_bt.errors import DroneError
from uav_bt.types import FlyingState, Land

_LANDING_S: Final = 20.0  # timeout of the landing after a failure, s


@dataclass(frozen=True, kw_only=True)
class DroneSetup:
    """Configuration of a loopback ANAFI."""

    scene: Scene | None = None  # None: the open field, with a GPS fix
    profile: Profile = field(default_factory=Profile)
    seed: int = 0  # random seed, 0 or more
    address: str = "127.0.0.1"  # the default is reachable from this machine only
    ports: Ports = field(default_factory=Ports)
    charge: float = 1.0  # of the battery, 0 to 1
    image_size_px: tuple[int, int] = (640, 360)  # 16:9; two cores sustain it beside a mission
    video_rate_hz: float = 30.0  # highest frame rate, that of the ANAFI
    video: bool = True
    skycontroller: bool = False  # whether clients connect to a remote control with a drone
    card: Card = Card.READY  # the memory card of the camera


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
        self._clock = WallClock()
        self.world = TwinWorld(
            setup.scene, profile=setup.profile, seed=setup.seed, clock=self._clock
        )
        media = MediaStore(card=setup.card)
        make_camera = partial(
            TwinCamera,
            self.world,
            image_size_px=setup.image_size_px,
            seed=setup.seed,
            clock=self._clock,
            battery=lambda: self._anafi.battery.charge,
        )
        self._camera = make_camera()
        self._photographer = Photographer(make_camera)
        self._anafi: Anafi = Anafi(
            self.world, shoot=self._photographer.shoot, media=media, charge=setup.charge
        )
        firmware = RemoteControl(self._anafi, self.world) if setup.skycontroller else self._anafi
        self._server = LoopbackServer(firmware, media, address=setup.address, ports=setup.ports)
        self._video: VideoServer | None = None

    @property
    def ports(self) -> Ports:
        """The ports that are bound."""
        ports = self._server.ports
        return ports if self._video is None else replace(ports, rtsp=self._video.address[1])

    def video_stats(self) -> VideoStats | None:
        """Return the statistics of the video; None without a video."""
        return None if self._video is None else self._video.stats()

    async def start(self) -> None:
        """Bind the ports and start the simulation.

        Raises:
            PortTakenError: a port is taken or may not be used.
            MissingDependencyError: the H.264 encoder is missing.
        """
        setup = self._setup
        try:
            if setup.video:
                encoder = EncoderConfig(size_px=setup.image_size_px, rate_hz=setup.video_rate_hz)
                self._video = await serve_video(
                    self._camera,
                    host=setup.address,
                    port=setup.ports.rtsp,
                    encoder=encoder,
                    serial=Identity().serial,
                    media_name=REMOTE_MEDIUM if setup.skycontroller else DIRECT_MEDIUM,
                    now=self._clock.now,
                    finish=self._camera.close,
                )
            self.world.start()
            await self._server.start()
        except BaseException:
            await self.close()
            raise

    async def wait(self) -> None:
        """Serve until the simulation or the firmware fails.

        Raises:
            DroneError: the simulation failed, or the firmware, whose drone then lands.
        """
        try:
            await self._server.wait()
        except DroneError:
            raise
        except Exception as error:
            where = "has landed" if await self._land() else "is still in the air"
            raise DroneError(
                f"the loopback's firmware failed ({type(error).__name__}: {error}); its drone "
                f"{where}. Restart it"
            ) from error

    async def close(self) -> None:
        """Disconnect and stop; safe to call twice."""
        await self._server.close()
        if self._video is not None:
            await self._video.close()
        await asyncio.to_thread(self._photographer.close)
        self.world.stop()

    async def _land(self) -> bool:
        self.world.move(Land())
        for _ in range(round(_LANDING_S / 0.1)):
            if self.world.state().flying is FlyingState.LANDED:
                return True
            await asyncio.sleep(0.1)
        return False
