"""What is installed here and what it is good for. Nothing is sent anywhere."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import platform
import sys
from collections.abc import Callable, Iterable, Iterator
from typing import Final

from packaging.requirements import Requirement

from uav_bt import __version__, plugins
from uav_bt.errors import UavBtError
from uav_bt.mission.preflight import Check

_PACKAGE: Final = "uav-bt"
_NEEDED: Final = (3, 11)
_SDK: Final = "parrot-olympe"
_SDK_BEYOND: Final = (3, 13)  # fails on import from there on
_NOT_FOR_USERS: Final = frozenset({"dev"})


def examine(draws: Callable[[], str]) -> Iterator[Check]:
    """Check the machine, line by line.

    Args:
        draws: draws an image of the lab and says with what; raises when it cannot.
    """
    yield _python()
    yield Check(what="uav-bt", good=True, found=__version__)
    yield from _packages()
    yield _olympe_python()
    yield _opengl(draws)
    for group, what in ((plugins.DRONES, "drones"), (plugins.POLICIES, "policies")):
        yield _registered(group, what)


def _python() -> Check:
    return Check(
        what="Python",
        good=sys.version_info >= _NEEDED,
        found=f"{platform.python_version()} on {platform.system()} {platform.machine()}",
        remedy="install Python 3.11 or newer",
    )


def _packages() -> Iterator[Check]:
    extras = importlib.metadata.metadata(_PACKAGE).get_all("Provides-Extra", ())
    needed = [Requirement(text) for text in importlib.metadata.requires(_PACKAGE) or ()]
    for extra in ("", *(name for name in extras if name not in _NOT_FOR_USERS)):
        yield _extra(extra, [one.name for one in needed if _belongs(one, extra)])


def _belongs(requirement: Requirement, extra: str) -> bool:
    marker = requirement.marker
    if marker is None:
        return not extra
    return marker.evaluate({"extra": extra}) and not (extra and marker.evaluate({"extra": ""}))


def _extra(extra: str, names: Iterable[str]) -> Check:
    versions = {name: _version(name) for name in dict.fromkeys(names)}
    missing = [name for name, version in versions.items() if version is None]
    there = ", ".join(f"{name} {version}" for name, version in versions.items() if version)
    found = there or "nothing of it"
    if missing:
        found += f"; missing: {', '.join(missing)}"
    return Check(
        what=f"extra {extra}" if extra else "needed packages",
        # Extras are a choice: without one, nothing is wrong.
        good=bool(extra) or not missing,
        found=found,
        remedy="install uav-bt again",
    )


def _version(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def _olympe_python() -> Check:
    installed = _version(_SDK)
    if installed is None:
        fits = sys.version_info < _SDK_BEYOND
        return Check(
            what="Parrot's SDK",
            good=True,
            found="not installed; `pip install 'uav-bt[olympe]'` flies ANAFIs"
            if fits
            else "not installed, and not to be had for this Python: it wants 3.10 to 3.12",
        )
    return Check(
        what="Parrot's SDK",
        good=sys.version_info < _SDK_BEYOND and importlib.util.find_spec("olympe") is not None,
        found=f"{_SDK} {installed}",
        remedy="it runs with Python 3.10 to 3.12 on Linux x86-64",
    )


def _opengl(draws: Callable[[], str]) -> Check:
    try:
        found, good = draws(), True
    except UavBtError as error:
        found, good = str(error), False
    return Check(what="drawing the lab", good=good, found=found)


def _registered(group: str, what: str) -> Check:
    faults = []
    names = plugins.names(group)
    for name in names:
        try:
            plugins.load(group, name)
        except UavBtError as error:
            faults.append(str(error))
    return Check(
        what=what,
        good=bool(names) and not faults,
        found="; ".join(faults) or ", ".join(names) or "none registered",
        remedy="install uav-bt again",
    )
