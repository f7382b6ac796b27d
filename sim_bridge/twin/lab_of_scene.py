"""The lab of a scene with the shapes of its kinds, read once while its file stays the same."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from sim_bridge.twin.placed import Shape, shapes_of
from uav_bt.lab.lab import LAB_FILE, Lab
from uav_bt.lab.shipped import load_lab, shipped_labs

_KEPT = 16  # labs


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneLab:
    """A lab with the shapes of its kinds by name."""

    lab: Lab
    shapes: Mapping[str, Shape]


def lab_of_scene(name: str) -> SceneLab:
    """Return a lab by name or path.

    Raises:
        UnknownNameError: there is no such lab.
        FileError: the lab file is malformed.
    """
    places = (shipped_labs().get(name), Path("labs") / name, Path(name))
    files = (place / LAB_FILE for place in places if place is not None)
    file = next((each for each in files if each.is_file()), Path(name))
    stamp = (str(file.resolve()), file.stat().st_mtime_ns) if file.is_file() else None
    return _read(name, stamp)


@lru_cache(maxsize=_KEPT)
def _read(name: str, _stamp: tuple[str, int] | None) -> SceneLab:
    lab = load_lab(name)
    return SceneLab(lab=lab, shapes=shapes_of(lab))
