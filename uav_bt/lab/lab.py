"""A lab: a place to fly in, real or simulated."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from uav_bt.errors import InputError
from uav_bt.lab.classes import LabClasses
from uav_bt.settings import brief_repr
from uav_bt.types.pose import Pose2D
from uav_bt.types.sizes import LandingMark

if TYPE_CHECKING:
    # pydantic takes long to import, and `uav-bt check` answers at once.
    from uav_bt.lab.flight_keys import FlightKeys, NetworkKeys, TeacherKeys
    from uav_bt.lab.room import Room

LAB_FILE: Final = "lab.yaml"
NETWORK_FILE: Final = "segmentation.onnx"  # beside the lab file; `uav-bt lab train` writes it
LABS_FOLDER: Final = "labs"  # below the working directory: labs that are found by name
SCENES_FOLDER: Final = "scenes"  # beside the lab file
_NAME: Final = re.compile(r"[a-z][a-z0-9_-]*")


def check_lab_name(name: str) -> None:
    """Refuse a text that cannot be the name of a lab's folder."""
    if not _NAME.fullmatch(name):
        expected = "small letters, digits, _ and -, with a letter first"
        raise InputError(f"the name of a lab consists of {expected}, got '{name}'")


@dataclass(frozen=True, kw_only=True)
class Lab:
    """A place, and how it is flown; `read_lab` reads one from its folder."""

    name: str  # of the folder
    folder: Path  # with the lab file, scenes and networks
    classes: LabClasses
    file: Path
    flight: FlightKeys
    teacher: TeacherKeys | None = None  # labels images; None: a teacher learns from picks
    mark: LandingMark | None = None
    mark_pose: Pose2D | None = None  # in the drawing, yaw counter-clockwise; None: not stated
    room: Room | None = None  # that the twin builds; None: the paper's

    __repr__ = brief_repr

    @property
    def network(self) -> NetworkKeys:
        """The networks that the lab is flown with; empty without any.

        They are those of the lab file. The segmentation network is else the one in its folder.
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
