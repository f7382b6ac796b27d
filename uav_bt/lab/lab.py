"""A lab: a place to fly in, real or simulated."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from uav_bt.lab.classes import LabClasses
from uav_bt.lab.flight_keys import FlightKeys
from uav_bt.types.landing_mark import LandingMark
from uav_bt.types.pose import Pose2D

LAB_FILE: Final = "lab.yaml"
SCENES_FOLDER: Final = "scenes"
"""Folder of a lab's scene files, in the folder of the lab file."""


@dataclass(frozen=True, kw_only=True)
class Lab:
    """A place, and how it is flown; `read_lab` reads one from its folder.

    Attributes:
        name: Name of the folder.
        folder: Folder of the lab file, with the scenes and networks.
        classes: Classes of the place.
        file: The lab file.
        mark: Landing mark of the place; None without one.
        mark_pose: Pose of the mark in the drawing, yaw counter-clockwise; None if not stated.
        flight: How the place is flown.
    """

    name: str
    folder: Path
    classes: LabClasses
    file: Path
    mark: LandingMark | None = None
    mark_pose: Pose2D | None = None
    flight: FlightKeys = field(default_factory=FlightKeys)

    @property
    def scenes(self) -> dict[str, Path]:
        """The scene files of the lab, by name, in the order of the names."""
        files = [*(self.folder / SCENES_FOLDER).glob("*.yaml")]
        return {file.stem: file for file in sorted(files)}
