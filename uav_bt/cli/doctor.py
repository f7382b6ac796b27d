"""`uav-bt doctor`: check of installed packages and, on request, of a drone."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from typing import Annotated

import click

from sim_bridge.twin import TwinConfig
from uav_bt import app
from uav_bt.app.assembly import frame_judge
from uav_bt.app.doctor import examine
from uav_bt.cli.declare import command
from uav_bt.mission.preflight import Check, check_drone
from uav_bt.option import Option


@command()
def doctor(*, drone: Annotated[str | None, Option(form="NAME[:ADDRESS]")] = None) -> bool:
    """Check the installation.

    Exits with 1 when something that uav-bt needs is wrong; extras are a choice.

    Options:
        drone: Connect to this drone, too, and check it as before a take-off. Without this option
            nothing is sent anywhere.
    """
    good = True
    for check in chain(examine(_draws), () if drone is None else _drone_checks(drone)):
        click.echo(str(check))
        good &= check.good or check.optional
    return good


def _draws() -> str:
    """Draw a small image of the lab; raises UavBtError if it cannot be drawn here."""
    twin = TwinConfig(image_size_px=(160, 90)).create()
    twin.connect()
    try:
        twin.clock.sleep_until(0.5)
        frame = twin.observe().frame
    finally:
        twin.disconnect()
    return "OpenGL works" if frame is not None else "OpenGL works, but no frame came"


def _drone_checks(drone: str) -> Iterator[Check]:
    flown = app.make_drone(app.FlightOptions(drone=drone))
    flown.connect()
    try:
        yield from check_drone(flown, judge_frame=frame_judge(flown))
    finally:
        flown.disconnect()
