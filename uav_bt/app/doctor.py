"""Check of the installed packages and their use. Nothing is sent anywhere."""

from __future__ import annotations

import importlib.util
import platform
import shutil
import sys
import textwrap
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from importlib import metadata
from pathlib import Path
from typing import Final

from packaging.requirements import Requirement

from uav_bt import __version__, plugins
from uav_bt.app.provenance import hardware
from uav_bt.errors import UavBtError
from uav_bt.mission.preflight import Check
from uav_bt.tree import NodeRegistry

_PACKAGE: Final = "uav-bt"
_AGAIN: Final = "install uav-bt again"
_SDK: Final = "parrot-olympe"
_SDK_BEYOND: Final = (3, 13)  # fails on import from there on
_LINE_WIDTH: Final = 80  # characters; the line's beginning comes in addition
_GROUPS: Final = {
    plugins.DRONES: "drones",
    plugins.POLICIES: "policies",
    plugins.LANDING_MARKS: "landing marks",
}


def examine(draws: Callable[[], str]) -> Iterator[Check]:
    """Check the machine, line by line; `draws` draws an image, and raises when it cannot."""
    python = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    yield Check("Python", good=True, found=python)
    free_gb = shutil.disk_usage(Path.cwd()).free / 1e9
    yield Check("machine", good=True, found=f"{hardware()}; {free_gb:.1f} GB free in this folder")
    yield Check(_PACKAGE, good=True, found=__version__)
    extras = metadata.metadata(_PACKAGE).get_all("Provides-Extra", ())
    needed = [Requirement(text) for text in metadata.requires(_PACKAGE) or ()]
    for extra in ("", *(name for name in extras if name != "dev")):
        yield _extra(extra, dict.fromkeys(one.name for one in needed if _belongs(one, extra)))
    yield _olympe()
    try:
        yield Check("drawing the lab", good=True, found=draws())
    except UavBtError as error:
        yield Check("drawing the lab", good=False, found=str(error))
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


def _belongs(requirement: Requirement, extra: str) -> bool:
    marker = requirement.marker
    if marker is None:
        return not extra
    return marker.evaluate({"extra": extra}) and not (extra and marker.evaluate({"extra": ""}))


def _extra(extra: str, names: Iterable[str]) -> Check:
    versions = {name: _version(name) for name in names}
    missing = ", ".join(name for name, version in versions.items() if not version)
    found = ", ".join(f"{name}=={version}" for name, version in versions.items() if version)
    if missing:
        found = f"{missing} (installed: {found})" if found else missing
    what = f"extra {extra}" if extra else "needed packages"
    told = "\n  ".join(textwrap.wrap(found, _LINE_WIDTH, break_on_hyphens=False))
    remedy = f"run {plugins.install_command(extra)}" if extra else _AGAIN
    return Check(what, not missing, told, remedy, optional=bool(extra))


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def _olympe() -> Check:
    version, fits = _version(_SDK), sys.version_info < _SDK_BEYOND
    good = bool(version) and fits and importlib.util.find_spec("olympe") is not None
    found, remedy = f"{_SDK} {version}", "it runs with Python 3.10 to 3.12 on Linux x86-64"
    if not version:
        found = f"{_SDK}, which flies ANAFIs{'' if fits else '; it needs Python 3.10 to 3.12'}"
        remedy = f"run {plugins.install_command('olympe')}" if fits else ""
    return Check("Parrot's SDK", good, found, remedy, optional=not version)


def _contributed(what: str, good: Iterable[str], faults: Iterable[str]) -> Check:
    found, wrong = ", ".join(good), [*faults]
    told = "\n  ".join([found or "none registered", *wrong])
    return Check(what, bool(found) and not wrong, told, "" if wrong else _AGAIN)
