"""Check of the installed packages and their use. Nothing is sent anywhere."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import platform
import shutil
import sys
import textwrap
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final

from packaging.requirements import Requirement

from uav_bt import __version__, plugins
from uav_bt.app.provenance import hardware
from uav_bt.errors import UavBtError
from uav_bt.mission.preflight import Check
from uav_bt.tree import NodeRegistry

_PACKAGE: Final = "uav-bt"
_NEEDED: Final = (3, 11)
_SDK: Final = "parrot-olympe"
_SDK_BEYOND: Final = (3, 13)  # fails on import from there on
_LINE_WIDTH: Final = 100  # characters
_NO_BREAK: Final = "\N{NO-BREAK SPACE}"  # keeps a package and its version in one line
_NOT_FOR_USERS: Final = frozenset({"dev"})


def examine(draws: Callable[[], str]) -> Iterator[Check]:
    """Check the machine, line by line.

    Args:
        draws: draws an image of the lab and returns the renderer's name; raises when it cannot.
    """
    yield _python()
    yield _machine()
    yield Check(what="uav-bt", good=True, found=__version__)
    yield from _packages()
    yield _olympe_python()
    yield _opengl(draws)
    yield _registered(plugins.DRONES, "drones")
    yield _registered(plugins.POLICIES, "policies")
    yield _registered(plugins.LANDING_MARKS, "landing marks")
    yield _behaviours()


def _python() -> Check:
    return Check(
        what="Python",
        good=sys.version_info >= _NEEDED,
        found=f"{platform.python_version()} on {platform.system()} {platform.machine()}"
        f" (supported: {_supported()})",
        remedy="install Python 3.11 or newer",
    )


def _machine() -> Check:
    free_gb = shutil.disk_usage(Path.cwd()).free / 1e9
    return Check(
        what="machine", good=True, found=f"{hardware()}; {free_gb:.1f} GB free in this folder"
    )


def _supported() -> str:
    """Return the versions of Python that the package says it is tried with."""
    head = "Programming Language :: Python :: "
    classifiers = importlib.metadata.metadata(_PACKAGE).get_all("Classifier", ())
    return ", ".join(text.removeprefix(head) for text in classifiers if text.startswith(head))


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
    what = f"extra {extra}" if extra else "needed packages"
    found = ", ".join(f"{name} {version}" for name, version in versions.items() if version)
    if missing:
        found = ", ".join(missing) + (f" (installed: {found})" if found else "")
    return Check(
        what=what,
        good=not missing,
        found=_wrapped(found, len(f"{what}: ok, ")),
        remedy=f"run {plugins.install_command(extra)}" if extra else "install uav-bt again",
        optional=bool(extra),
    )


def _wrapped(text: str, begin: int) -> str:
    """Return a list in lines of limited width; the first one begins in a given column."""
    lines = textwrap.fill(
        text.replace(" ", _NO_BREAK).replace(f",{_NO_BREAK}", ", "),
        _LINE_WIDTH,
        initial_indent=" " * begin,
        subsequent_indent="  ",
        break_on_hyphens=False,
    )
    return lines[begin:].replace(_NO_BREAK, " ")


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
            good=False,
            found=f"{_SDK}, which flies ANAFIs"
            + ("" if fits else "; it needs Python 3.10 to 3.12"),
            remedy=f"run {plugins.install_command('olympe')}" if fits else "",
            optional=True,
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
    good, faults = [], []
    for name in plugins.names(group):
        try:
            plugins.load(group, name)
        except UavBtError as error:
            faults.append(str(error))
        else:
            good.append(name)
    return _contributed(what, good, faults)


def _behaviours() -> Check:
    try:
        registry = NodeRegistry.installed()
    except UavBtError as error:
        return _contributed("behaviours", [], [str(error)])
    packages = Counter(registry[name].__module__.partition(".")[0] for name in registry)
    good = [f"{package} ({count} nodes)" for package, count in packages.items()]
    return _contributed("behaviours", good, registry.faults)


def _contributed(what: str, good: Sequence[str], faults: Sequence[str]) -> Check:
    return Check(
        what=what,
        good=bool(good) and not faults,
        found="\n  ".join([", ".join(good) or "none registered", *faults]),
        remedy="" if faults else "install uav-bt again",
    )
