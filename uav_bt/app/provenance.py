"""Origin of results for records and campaigns: code, packages, networks."""

from __future__ import annotations

import hashlib
import importlib.metadata
import os
import platform
import shutil
import subprocess
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
    """Return the commit of the checkout that a folder belongs to; None outside a checkout.

    Args:
        folder: anywhere in the checkout.

    Returns:
        The commit's hash, followed by ``+changes`` when files that git follows differ from it.
    """
    git = shutil.which("git")
    head = None if git is None else _output(git, folder, "rev-parse", "HEAD")
    if git is None or head is None:
        return None
    changed = _output(git, folder, "status", "--porcelain", "--untracked-files=no")
    return f"{head}+changes" if changed else head


def _output(git: str, folder: Path, *arguments: str) -> str | None:
    try:
        done = subprocess.run(  # noqa: S603 - git itself, with arguments of our own
            # Without its locks: `status` would renew the index, and one that is stopped while it
            # does leaves a lock behind that keeps people from committing.
            [git, "--no-optional-locks", "-C", str(folder), *arguments],
            capture_output=True,
            text=True,
            check=True,
            timeout=_GIT_LIMIT_S,
        )
    except (OSError, subprocess.SubprocessError):
        return None  # a record without a commit is better than no flight
    return done.stdout.strip()


def hardware(cpu_info: Path = Path("/proc/cpuinfo")) -> str:
    """Return processor, cores, VNNI, memory, system and Python of this machine, in one line.

    Args:
        cpu_info: Linux's description of the processor. Other systems have no such file.
    """
    lines = cpu_info.read_text(encoding="utf-8").splitlines() if cpu_info.is_file() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    flags = {word for line in lines if line.startswith("flags") for word in line.split()}
    vnni = "VNNI" if flags & {"avx_vnni", "avx512_vnni"} else "no VNNI"
    return ", ".join(
        (
            names[0] if names else platform.machine(),
            f"{os.cpu_count()} cores",
            vnni if flags else "VNNI unknown",
            _memory(),
            _system(),
            f"Python {platform.python_version()}",
        )
    )


def _memory() -> str:
    try:
        total = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):  # Windows, or a system without these names
        return "memory unknown"
    return f"{total / 2**30:.1f} GiB memory"


def _system() -> str:
    kernel = f"{platform.system()} {platform.release()}"
    try:
        return f"{platform.freedesktop_os_release()['PRETTY_NAME']} ({kernel})"
    except (OSError, KeyError):  # not a Linux distribution, or one without this file
        return kernel


def package_versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that a flight depends on."""
    versions = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            versions[package] = "none"
    return versions


def weights_of(*missions: MissionTree) -> dict[str, str]:
    """Return the SHA-256 of the files that leaves name in their ports, shipped weights included.

    Args:
        missions: loaded trees.

    Returns:
        Checksums by the file's name.
    """
    files: dict[str, Path] = {}
    for mission in missions:
        for leaf in mission.leaves():
            for port in leaf.ports:
                value = leaf.initial_value(port) if port.type is str else None
                if value == ANY and port.look_up is None:
                    continue  # 'any' is also a heading, and a place to land
                files |= {file.name: file for file in _files_meant(value)}
    return {name: _file_sha256(file, file.stat().st_mtime_ns) for name, file in files.items()}


def _files_meant(value: object) -> list[Path]:
    if not isinstance(value, str) or not value:
        return []
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
    """Return the SHA-256 of a mission's texts: its own file and all that it includes."""
    return hashlib.sha256(b"\0".join(mission.sources.values())).hexdigest()
