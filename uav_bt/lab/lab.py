"""A lab: a place to fly in, real or simulated."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from uav_bt.brief import brief_repr
from uav_bt.errors import InputError
from uav_bt.lab.classes import LabClasses
from uav_bt.types.landing_mark import LandingMark
from uav_bt.types.pose import Pose2D

if TYPE_CHECKING:
    # pydantic takes long to import, and `uav-bt check` answers at once.
    from uav_bt.lab.flight_keys import FlightKeys, NetworkKeys, TeacherKeys
    from uav_bt.lab.room import Room

LAB_FILE: Final = "lab.yaml"
NETWORK_FILE: Final = "segmentation.onnx"
"""Segmentation network of a lab, in the folder of the lab file; `uav-bt lab train` writes it."""

SCENES_FOLDER: Final = "scenes"
"""Folder of a lab's scene files, in the folder of the lab file."""


_NAME: Final = re.compile(r"[a-z][a-z0-9_-]*")


def check_lab_name(name: str) -> None:
    """Refuse a text that cannot be the name of a lab's folder.

    Raises:
        InputError: It has other characters than small letters, digits, _ and -.
    """
    if not _NAME.fullmatch(name):
        raise InputError(
            "the name of a lab consists of small letters, digits, _ and -, and begins with a "
            f"letter, got '{name}'"
        )


@dataclass(frozen=True, kw_only=True)
class Lab:
    """A place, and how it is flown; `read_lab` reads one from its folder.

    Attributes:
        name: Name of the folder.
        folder: Folder of the lab file, with the scenes and networks.
        classes: Classes of the place.
        file: The lab file.
        flight: How the place is flown.
        teacher: Network that labels the images for training; None: a teacher learns from picks.
        mark: Landing mark of the place; None without one.
        mark_pose: Pose of the mark in the drawing, yaw counter-clockwise; None if not stated.
        room: Room that the twin builds; None: the paper's.
    """

    name: str
    folder: Path
    classes: LabClasses
    file: Path
    flight: FlightKeys
    teacher: TeacherKeys | None = None
    mark: LandingMark | None = None
    mark_pose: Pose2D | None = None
    room: Room | None = None

    __repr__ = brief_repr

    @property
    def network(self) -> NetworkKeys:
        """The networks that the lab is flown with; empty without any.

        They are those of the lab file. The segmentation network is else the one in the folder of
        the lab.
        """
        stated, trained = self.flight.network or {}, self.folder / NETWORK_FILE
        if "model" in stated or not trained.is_file():
            return stated
        return {**stated, "model": str(trained)}

    @property
    def scenes(self) -> dict[str, Path]:
        """The scene files of the lab, by name, in the order of the names."""
        files = [*(self.folder / SCENES_FOLDER).glob("*.yaml")]
        return {file.stem: file for file in sorted(files)}
