"""Labs by name: those that ship with the project, and the folders of a user."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Final

from uav_bt.errors import FileError, InputError, UnknownNameError
from uav_bt.files import write_whole, writing
from uav_bt.lab.lab import LAB_FILE, LABS_FOLDER, SCENES_FOLDER, Lab, check_lab_name
from uav_bt.types.sizes import LandingMark

DEFAULT_LAB: Final = "paper"
_LABS: Final = Path(__file__).parents[1] / "labs"  # in a checkout a link to the folder above


@cache  # asked in every tick, and a folder is slow to list
def shipped_labs() -> Mapping[str, Path]:
    """Return the folders of the labs that ship with the project, by name."""
    return {path.parent.name: path.parent for path in sorted(_LABS.glob(f"*/{LAB_FILE}"))}


def load_lab(name_or_path: str | Path = DEFAULT_LAB) -> Lab:
    """Read a lab by the name of one that ships, or by the path of a folder with a lab file.

    A name may also be that of a folder in `labs/` below the working directory.
    """
    name, path, shipped = str(name_or_path), Path(name_or_path), shipped_labs()
    if "/" in name or len(path.parts) != 1 or path.suffix in (".yaml", ".yml"):
        return _read(path)
    own = Path(LABS_FOLDER) / name
    ours = shipped.get(name)
    if ours is None:
        if (own / LAB_FILE).is_file():
            return _read(own)
        if path.is_dir():
            return _read(path)
        owned = (file.parent.name for file in Path(LABS_FOLDER).glob(f"*/{LAB_FILE}"))
        raise UnknownNameError("lab", name, {*shipped, *owned})
    if (own / LAB_FILE).is_file() and not own.samefile(ours):
        remedy = f"give the path ./{own} for yours, or rename its folder"
        raise InputError(f"the lab '{name}' ships with uav-bt, and {own} is another: {remedy}")
    return _shipped_lab(ours)


def lab_address(lab: Lab) -> str:
    """Return what `load_lab` finds a lab by from every folder: a shipped name, or a path."""
    ours = shipped_labs().get(lab.name)
    shipped = ours is not None and ours.resolve() == lab.folder.resolve()
    return lab.name if shipped else str(lab.file.resolve())


def default_mark() -> LandingMark:
    """Return the landing mark of the default lab, for places that state none."""
    lab = load_lab()
    if lab.mark is None:
        raise InputError(f"the lab '{lab.name}' states no landing mark: add 'mark' to its lab file")
    return lab.mark


def write_lab(name: str, folder: Path, *, simulated: bool = False) -> Path:
    """Write the commented lab file of a new place into the folder of the labs; return its path.

    With `simulated` it describes a furnished room, and a scene in it is written, too.
    """
    check_lab_name(name)
    if name in shipped_labs():
        raise InputError(f"a lab '{name}' ships with uav-bt: choose another name")
    path = folder / name / LAB_FILE
    if path.parent.exists():
        raise FileError(path.parent, "exists: choose another name, or edit its lab.yaml")
    starters = {path: "starter.yaml"}
    if simulated:
        scene = path.parent / SCENES_FOLDER / f"{name}-a.yaml"
        starters = {path: "starter-room.yaml", scene: "starter-scene.yaml"}
    try:
        for target, starter in starters.items():
            with writing(target):
                target.parent.mkdir(parents=True)
            write_whole(target, (_LABS / starter).read_bytes())
    except FileError:
        shutil.rmtree(path.parent, ignore_errors=True)  # the name is free for another try
        raise
    return path


@cache
def _shipped_lab(folder: Path) -> Lab:
    return _read(folder)


def _read(path: Path) -> Lab:
    # Late: `uav-bt check` must answer at once, and YAML takes long to import.
    from uav_bt.lab.lab_file import read_lab  # noqa: PLC0415

    return read_lab(path)
