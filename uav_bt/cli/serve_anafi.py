"""`uav-bt serve-anafi`: a simulated ANAFI for clients of the real one."""

from __future__ import annotations

import asyncio
import logging
import signal
from typing import Any

import click

from sim_bridge.loopback.drone import DroneSetup, LoopbackDrone
from sim_bridge.loopback.firmware.telemetry_events import BatteryOptions
from sim_bridge.loopback.handshake import Identity, Ports
from sim_bridge.loopback.media import Card
from sim_bridge.loopback.server import ServerOptions
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene_file import load_scene
from uav_bt.cli.command import Command
from uav_bt.cli.flight_options import flight_option
from uav_bt.cli.options import Decorator, grouped
from uav_bt.cli.values import Number, WholeNumber


def _port(name: str, what: str) -> Decorator:
    return click.option(
        f"--{name}-port",
        name,
        type=WholeNumber(0, 65_535),
        default=getattr(Ports, name),
        help=f"{what}; 0 takes a free one.",
    )


@click.command(cls=Command)
@grouped(
    "settings",
    dict,
    scene=click.option(
        "--scene",
        metavar="SCENE",
        help="Fly in this lab: a shipped scene or a YAML file. Without it the drone has an open "
        "field and an outdoor drone's pace, as scripts for the ANAFI expect.",
    ),
    seed=flight_option("seed"),
    profile=flight_option("profile"),
    image_size_px=flight_option("image_size_px"),
    video_rate_hz=click.option(
        "--rate",
        "video_rate_hz",
        type=Number(0.1, 240.0),
        default=30.0,
        help="Frames of video a second, at most.",
    ),
    video=click.option(
        "--no-video",
        "video",
        is_flag=True,
        flag_value=False,
        default=True,
        show_default=False,
        help="Serve no video.",
    ),
    gps=click.option(
        "--gps/--no-gps",
        default=None,
        help="Whether it has a GPS fix. Without either it has one in the open field, none in a "
        "lab.",
    ),
    skycontroller=click.option(
        "--skycontroller",
        is_flag=True,
        help="Serve a SkyController 3 with the drone behind it: olympe.SkyController3(ADDRESS).",
    ),
)
@click.option(
    "--address",
    default="127.0.0.1",
    help="Where it listens. For several drones: 127.0.0.2, 127.0.0.3, ... At any address other "
    "than 127.x.x.x, everybody who can reach it can fly the drone.",
)
@click.option(
    "--battery",
    "battery_percent",
    type=WholeNumber(0, 100),
    default=100,
    help="The battery's charge at first, per cent.",
)
@click.option(
    "--card",
    type=click.Choice([each.value for each in Card]),
    default=Card.READY.value,
    help="Its memory card. With a full or an absent one, photographs fail.",
)
@click.option("--name", default="ANAFI-loopback", help="Its product name.")
@click.option("--verbose", is_flag=True, help="Log connections and damaged messages, too.")
@grouped(
    "ports",
    Ports,
    discovery=_port("discovery", "TCP, where clients find it"),
    control=_port("control", "TCP, where clients ask for a link"),
    commands=_port("commands", "UDP, where commands go"),
    http=_port("http", "TCP, its web server"),
    rtsp=_port("rtsp", "TCP, its video"),
)
def serve_anafi(
    *,
    settings: dict[str, Any],
    address: str,
    battery_percent: int,
    card: str,
    name: str,
    verbose: bool,
    ports: Ports,
) -> None:
    """Serve a loopback ANAFI until Ctrl-C.

    A process that speaks the ANAFI's protocol and streams video from the twin, so that scripts
    written for Parrot's Olympe fly it unchanged: olympe.Drone("127.0.0.1"). It needs neither a
    drone nor Olympe. The drone's own web and video ports, 80 and 554, need root; without it choose
    others, such as --http-port 8080 --rtsp-port 8554, and tell the script.
    """
    logging.basicConfig(
        level=logging.INFO if verbose else logging.WARNING, format="%(levelname)s %(message)s"
    )
    scene, profile = settings.pop("scene"), Profile.named(settings.pop("profile"))
    setup = DroneSetup(
        scene=None if scene is None else load_scene(scene),
        profile=profile,
        server=ServerOptions(address=address, ports=ports, identity=Identity(name=name)),
        battery=BatteryOptions(charge=battery_percent / 100.0),
        card=Card(card),
        **settings,
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
        try:
            await served
        except asyncio.CancelledError:
            click.echo(_farewell(drone))
    finally:
        await drone.close()


def _greeting(setup: DroneSetup, drone: LoopbackDrone) -> str:
    address, ports = setup.server.address, drone.ports
    lab = "an open field" if setup.scene is None else f"lab '{setup.scene.name}'"
    width, height = setup.image_size_px
    video = "no video"
    if setup.video:
        video = f"video {width}x{height} at rtsp://{address}:{ports.rtsp}/live"
    how = " behind a SkyController 3" if setup.skycontroller else ""
    return (
        f"'{setup.server.identity.name}' stands in {lab}{how}, at {address}: discovery "
        f"{ports.discovery}, control {ports.control}, commands {ports.commands}, "
        f"http {ports.http}; {video}. Ctrl-C ends it."
    )


def _farewell(drone: LoopbackDrone) -> str:
    lines = []
    stats = drone.video_stats()
    if stats is not None:
        lines.append(
            f"video: {stats.frames_encoded} frames made, {stats.rate_hz:.1f} a second lately, "
            f"{stats.frames_late} slots missed; drawing and encoding took "
            "{:.1f} ms a frame (95 %: {:.1f}), and it was sent {:.1f} ms ({:.1f}) after its "
            "capture".format(*stats.encode_ms, *stats.age_ms)
        )
    if (lost_s := drone.world.lost_s) > 0.0:
        lines.append(f"the machine was too slow: {lost_s:.1f} s of flight were left out")
    return "\n".join([*lines, "stopped"])
