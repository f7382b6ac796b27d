"""A lab: a place to fly in, real or simulated."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from uav_bt.lab.classes import LabClasses
from uav_bt.types.landing_mark import LandingMark

if TYPE_CHECKING:  # its form imports pydantic, which `uav-bt check` does not need
    from uav_bt.lab.room import Room

LAB_FILE: Final = "lab.yaml"


@dataclass(frozen=True, kw_only=True)
class Lab:
    """A place with its classes; `read_lab` reads one from its folder.

    Attributes:
        name: Name of the folder.
        folder: Folder of the lab file, with the scenes and networks.
        classes: Classes of the place.
        mark: Landing mark of the place; None without one.
        room: What the twin builds of the place; None: as the paper's.
    """

    name: str
    folder: Path
    classes: LabClasses
    mark: LandingMark | None = None
    room: Room | None = None
