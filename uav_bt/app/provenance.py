"""Origin of results for records and campaigns: code, packages, networks."""

from __future__ import annotations

import hashlib
import importlib.metadata
import os
import platform
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Final

import uav_bt
from perception.networks.weights_file import ANY, SHIPPED_WEIGHTS
from uav_bt.tree import MissionTree

# Packages that affect a flight's numbers, ours first.
_PACKAGES: Final = (
    *("uav-bt", "numpy", "py_trees", "opencv-python-headless", "openvino", "mujoco"),
    *("scikit-learn", "filterpy"),
)
_GIT_LIMIT_S: Final = 5.0


@lru_cache(maxsize=8)
def commit(folder: Path = Path(uav_bt.__file__).parent) -> str | None:
    """Return the commit of a checkout, with ``+changes`` if its files differ; None without one."""
    # `status` renews the index, and when stopped leaves a lock that keeps people from committing.
    command = ["git", "--no-optional-locks", "-C", str(folder), "status"]
    command += ["--porcelain=v2", "--branch", "--untracked-files=no"]
    with suppress(OSError, subprocess.SubprocessError):  # better no commit than no flight
        found = subprocess.check_output(  # noqa: S603 - git itself, with arguments of our own
            command, stderr=subprocess.DEVNULL, text=True, timeout=_GIT_LIMIT_S
        ).splitlines()
        changes = "" if all(line.startswith("#") for line in found) else "+changes"
        return found[0].removeprefix("# branch.oid ") + changes
    return None


def hardware(cpu_info: Path = Path("/proc/cpuinfo")) -> str:
    """Return processor, memory, system and Python of this machine, in one line."""
    lines = cpu_info.read_text(encoding="utf-8").splitlines() if cpu_info.is_file() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    flags = {word for line in lines if line.startswith("flags") for word in line.split()}
    vnni = "VNNI" if flags & {"avx_vnni", "avx512_vnni"} else "no VNNI"
    memory = "memory unknown"
    with suppress(AttributeError, OSError, ValueError):  # Windows has no such names
        total = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        memory = f"{total / 2**30:.1f} GiB memory"
    return (
        f"{names[0] if names else platform.machine()}, {os.cpu_count()} cores, "
        f"{vnni if flags else 'VNNI unknown'}, {memory}, {platform.platform()}, "
        f"Python {platform.python_version()}"
    )


def package_versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that a flight depends on."""
    versions = {package: version_of(package) or "none" for package in _PACKAGES}
    return {"python": platform.python_version(), **versions}


def version_of(package: str) -> str:
    """Return the version of an installed package; an empty text where it is not installed."""
    with suppress(importlib.metadata.PackageNotFoundError):
        return importlib.metadata.version(package)
    return ""


def weights_of(*missions: MissionTree) -> dict[str, str]:
    """Return the SHA-256 of each network file that the missions use, by the file's name."""
    files = {file.name: file for mission in missions for file in files_of(mission)}
    return {name: _file_sha256(file, file.stat().st_mtime_ns) for name, file in files.items()}


def files_of(mission: MissionTree) -> Iterator[Path]:
    """Yield the files that leaves name in their ports, shipped weights included."""
    for leaf in mission.leaves():
        for port in leaf.ports:
            value = leaf.initial_value(port) if port.type is str else None
            # 'any' is also a heading, and a place to land
            if isinstance(value, str) and not (value == ANY and port.look_up is None):
                yield from _files_meant(value)


def _files_meant(value: str) -> list[Path]:
    for name in (value, value.partition(":")[2]):  # of a policy: NAME:FILE
        if name and Path(name).is_file():
            return [Path(name)]
    # A network's name; the ONNX file flies, where there is one.
    shipped = [SHIPPED_WEIGHTS / f"{value}{suffix}" for suffix in (".onnx", ".safetensors")]
    return [file for file in shipped if file.is_file()][:1]


@lru_cache(maxsize=64)
def _file_sha256(file: Path, _changed_ns: int) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def sha256_of(mission: MissionTree) -> str:
    """Return the SHA-256 of a mission's file and of all that it includes."""
    return hashlib.sha256(b"\0".join(mission.sources.values())).hexdigest()
