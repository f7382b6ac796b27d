"""`uav-bt doctor`: check of installed packages and, on request, of a drone."""

from __future__ import annotations

import platform
import shutil
import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib import metadata
from itertools import chain
from pathlib import Path
from typing import Annotated, Final

import click
from packaging.requirements import Requirement

from sim_bridge.twin import TwinConfig
from uav_bt import __version__, app, plugins
from uav_bt.app.assembly import frame_judge
from uav_bt.app.provenance import hardware, version_of
from uav_bt.cli.declare import command
from uav_bt.errors import UavBtError
from uav_bt.mission.preflight import Check, check_drone
from uav_bt.option import Option
from uav_bt.protocols import Drone
from uav_bt.tree import NodeRegistry

_PACKAGE: Final = "uav-bt"
_AGAIN: Final = "install uav-bt again"
_LINE_WIDTH: Final = 80  # characters; the line's beginning comes in addition
_GROUPS: Final = {
    plugins.DRONES: "drones",
    plugins.POLICIES: "policies",
    plugins.LANDING_MARKS: "landing marks",
}


@command()
def doctor(*, drone: Annotated[str | None, Option(form="NAME[:ADDRESS]")] = None) -> bool:
    """Check the installation.

    Exits with 1 when something that uav-bt needs is wrong; extras are a choice.

    Options:
        drone: Connect to this drone, too, and check it as before a take-off. Without this option
            nothing is sent anywhere.
    """
    good = True
    for check in chain(_installation(), () if drone is None else _drone_checks(drone)):
        click.echo(str(check))
        good &= check.good or check.optional
    return good


def _installation() -> Iterator[Check]:
    """Check the machine, the packages and what they contribute."""
    python = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    yield Check("Python", good=True, found=python)
    free_gb = shutil.disk_usage(Path.cwd()).free / 1e9
    yield Check("machine", good=True, found=f"{hardware()}; {free_gb:.1f} GB free in this folder")
    yield Check(_PACKAGE, good=True, found=__version__)
    always = _packages("")
    yield _installed("needed packages", always, "")
    for extra in metadata.metadata(_PACKAGE).get_all("Provides-Extra", ()):
        if extra != "dev":
            own = [name for name in _packages(extra) if name not in always]
            yield _installed(f"extra {extra}", own, extra)
    yield _drawing()
    for group, what in _GROUPS.items():
        good, faults = [], []
        for name in plugins.names(group):
            try:
                plugins.load(group, name)
                good.append(name)
            except UavBtError as error:
                faults.append(str(error))
        yield _contributed(what, good, faults)
    try:
        registry = NodeRegistry.installed()
    except UavBtError as error:
        yield _contributed("behaviours", [], [str(error)])
        return
    packages = Counter(registry[name].__module__.partition(".")[0] for name in registry)
    nodes = [f"{package} ({count} nodes)" for package, count in packages.items()]
    yield _contributed("behaviours", nodes, registry.faults)


def _packages(extra: str) -> list[str]:
    """Return the packages of an installation with an extra; "": of any installation."""
    needed = [Requirement(text) for text in metadata.requires(_PACKAGE) or ()]
    return [
        one.name for one in needed if one.marker is None or one.marker.evaluate({"extra": extra})
    ]


def _installed(what: str, packages: Iterable[str], extra: str) -> Check:
    versions = {name: version_of(name) for name in packages}
    missing = ", ".join(name for name, version in versions.items() if not version)
    found = ", ".join(f"{name}=={version}" for name, version in versions.items() if version)
    if missing:
        found = f"{missing} (installed: {found})" if found else missing
    told = "\n  ".join(textwrap.wrap(found, _LINE_WIDTH, break_on_hyphens=False))
    remedy = f"run {plugins.install_command(extra)}" if extra else _AGAIN
    return Check(what, not missing, told, remedy, optional=bool(extra))


def _drawing() -> Check:
    """Draw a small image of the lab."""
    try:
        with _connected(TwinConfig(image_size_px=(160, 90)).create()) as twin:
            twin.clock.sleep_until(0.5)
            twin.observe()
    except UavBtError as error:
        return Check("drawing the lab", good=False, found=str(error))
    return Check("drawing the lab", good=True, found="OpenGL works")


def _contributed(what: str, good: Iterable[str], faults: Sequence[str]) -> Check:
    found = ", ".join(good)
    told = "\n  ".join([found or "none registered", *faults])
    return Check(what, bool(found) and not faults, told, "" if faults else _AGAIN)


def _drone_checks(drone: str) -> Iterator[Check]:
    with _connected(app.make_drone(app.FlightOptions(drone=drone))) as flown:
        yield from check_drone(flown, judge_frame=frame_judge(flown))


@contextmanager
def _connected(drone: Drone) -> Iterator[Drone]:
    drone.connect()
    try:
        yield drone
    finally:
        drone.disconnect()
