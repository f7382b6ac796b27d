"""`uav-bt serve-anafi`: a simulated ANAFI for clients of the real one."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Iterator
from contextlib import suppress
from typing import Annotated, Literal

import click
from annotated_types import Ge, Le

from sim_bridge.loopback.drone import DroneSetup, LoopbackDrone
from sim_bridge.loopback.handshake import ANAFI, Ports
from sim_bridge.loopback.media import Card
from sim_bridge.twin.profile import Profile as TwinProfile
from sim_bridge.twin.scene_file import load_scene
from uav_bt.app.option_values import ImageSize, Profile, Seed
from uav_bt.cli.declare import command
from uav_bt.option import Option


@command()
def serve_anafi(
    *,
    scene: Annotated[str | None, Option(form="SCENE")] = None,
    seed: Seed = 0,
    profile: Profile = "lab",
    image_size_px: ImageSize = (640, 360),
    video_rate_hz: Annotated[float, Ge(0.1), Le(240), Option(form="--rate")] = 30.0,
    no_video: bool = False,
    skycontroller: bool = False,
    address: str = "127.0.0.1",
    battery_percent: Annotated[int, Ge(0), Le(100), Option(form="--battery")] = 100,
    card: Literal["ready", "full", "absent"] = "ready",
    ports: Annotated[Ports, Option(parts=Ports)],
) -> None:
    """Serve a loopback ANAFI until Ctrl-C.

    A process that speaks the ANAFI's protocol and streams video from the twin, so that scripts
    written for Parrot's Olympe fly it unchanged: olympe.Drone("127.0.0.1"). It needs neither a
    drone nor Olympe. The drone's own web and video ports, 80 and 554, need root; without it choose
    others, such as --http-port 8080 --rtsp-port 8554, and tell the script.

    Options:
        scene: Fly in this lab: a scene by name, or a YAML file. Without it the drone has an open
            field, a GPS fix and an outdoor drone's pace, as scripts for the ANAFI expect.
        video_rate_hz: Frames of video a second, at most.
        no_video: Serve no video.
        skycontroller: Serve a SkyController 3 with the drone behind it:
            olympe.SkyController3(ADDRESS).
        address: Where it listens. For several drones: 127.0.0.2, 127.0.0.3, ... At any address
            other than 127.x.x.x, everybody who can reach it can fly the drone.
        battery_percent: The battery's charge at first, per cent.
        card: Its memory card. With a full or an absent one, photographs fail.
    """
    setup = DroneSetup(
        address=address,
        ports=ports,
        charge=battery_percent / 100.0,
        card=Card(card),
        scene=None if scene is None else load_scene(scene),
        seed=seed,
        profile=TwinProfile.named(profile),
        image_size_px=image_size_px,
        video_rate_hz=video_rate_hz,
        video=not no_video,
        skycontroller=skycontroller,
    )
    asyncio.run(_serve(setup))


async def _serve(setup: DroneSetup) -> None:
    """Serve until a signal asks for the end.

    Raises:
        DroneError: the simulation failed.
    """
    loop = asyncio.get_running_loop()
    drone = LoopbackDrone(setup)
    await drone.start()
    try:
        served = asyncio.create_task(drone.wait())
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, served.cancel)
        click.echo(_greeting(setup, drone))
        with suppress(asyncio.CancelledError):
            await served
        click.echo("\n".join(_farewell(drone)))
    finally:
        await drone.close()


def _greeting(setup: DroneSetup, drone: LoopbackDrone) -> str:
    address, ports = setup.address, drone.ports
    lab = "an open field" if setup.scene is None else f"lab '{setup.scene.name}'"
    width, height = setup.image_size_px
    video = "no video"
    if setup.video:
        video = f"video {width}x{height} at rtsp://{address}:{ports.rtsp}/live"
    how = " behind a SkyController 3" if setup.skycontroller else ""
    return (
        f"'{ANAFI.name}' stands in {lab}{how}, at {address}: discovery "
        f"{ports.discovery}, control {ports.control}, commands {ports.commands}, "
        f"http {ports.http}; {video}. Ctrl-C ends it."
    )


def _farewell(drone: LoopbackDrone) -> Iterator[str]:
    stats = drone.video_stats()
    if stats is not None:
        yield (
            f"video: {stats.frames_encoded} frames made, {stats.rate_hz:.1f} a second lately, "
            f"{stats.frames_late} slots missed"
        )
    if (lost_s := drone.world.lost_s) > 0.0:
        yield f"the machine was too slow: {lost_s:.1f} s of flight were left out"
    yield "stopped"
