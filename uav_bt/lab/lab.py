"""A lab: a place to fly in, real or simulated."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from uav_bt.lab.classes import LabClasses
from uav_bt.types.landing_mark import LandingMark

LAB_FILE: Final = "lab.yaml"


@dataclass(frozen=True, kw_only=True)
class Lab:
    """A place with its classes; `read_lab` reads one from its folder.

    Attributes:
        name: Name of the folder.
        folder: Folder of the lab file, with the scenes and networks.
        classes: Classes of the place.
        mark: Landing mark of the place; None without one.
    """

    name: str
    folder: Path
    classes: LabClasses
    mark: LandingMark | None = None
