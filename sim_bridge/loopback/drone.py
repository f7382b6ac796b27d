"""A whole loopback ANAFI: twin, firmware, command link and video."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field
from typing import Final

from sim_bridge.loopback.firmware.anafi import Anafi
from sim_bridge.loopback.firmware.remote_control import RemoteControl
from sim_bridge.loopback.handshake import ANAFI, Ports
from sim_bridge.loopback.media import Card, MediaStore, Photographer
from sim_bridge.loopback.server import LoopbackServer
from sim_bridge.loopback.streamer import VideoStats
from sim_bridge.loopback.twin_camera import TwinCamera
from sim_bridge.loopback.twin_world import TwinWorld
from sim_bridge.loopback.video import DIRECT_MEDIUM, REMOTE_MEDIUM, VideoServer
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
    """Server of an ANAFI's protocols, which flies the twin: `start`, `wait`, `close`.

    Raises:
        MissingDependencyError: MuJoCo, OpenGL or the H.264 encoder does not work here.
        ValueRangeError: the video's size is not 16:9.
    """

    def __init__(self, setup: DroneSetup) -> None:
        clock, media = WallClock(), MediaStore(card=setup.card)
        self.world = TwinWorld(setup.scene, setup.profile, setup.seed, clock)

        def camera() -> TwinCamera:
            return TwinCamera(
                self.world,
                image_size_px=setup.image_size_px,
                seed=setup.seed,
                clock=clock,
                battery=lambda: anafi.battery.charge,
            )

        stills, film = camera(), camera()
        self._photographer = Photographer(stills.newest, stills.close)
        anafi: Anafi = Anafi(
            self.world, shoot=self._photographer.shoot, media=media, charge=setup.charge
        )
        firmware = RemoteControl(anafi, self.world) if setup.skycontroller else anafi
        self._video: VideoServer | None = None
        if setup.video:
            self._video = VideoServer(
                film.newest,
                size_px=setup.image_size_px,
                rate_hz=setup.video_rate_hz,
                serial=ANAFI.serial,
                media_name=REMOTE_MEDIUM if setup.skycontroller else DIRECT_MEDIUM,
                now=clock.now,
                finish=film.close,
            )
        self._server = LoopbackServer(
            firmware, media, self._video, address=setup.address, ports=setup.ports
        )

    @property
    def ports(self) -> Ports:
        """The ports that are bound."""
        return self._server.ports

    def video_stats(self) -> VideoStats | None:
        """Return the statistics of the video; None without a video."""
        return None if self._video is None else self._video.streamer.stats()

    async def start(self) -> None:
        """Bind the ports and start the simulation; PortTakenError if a port cannot be used."""
        try:
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
        await asyncio.to_thread(self._photographer.close)
        self.world.stop()

    async def _land(self) -> bool:
        """Land; return whether the drone is down in time."""
        self.world.move(Land())
        for _ in range(round(_LANDING_S / 0.1)):
            if self.world.state().flying is FlyingState.LANDED:
                return True
            await asyncio.sleep(0.1)
        return False
