"""From a flight's footage to a lab folder with a network for the place."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from perception.networks.named import ROLES
from perception.odometry.camera_track import Footage
from perception.segmentation.adaptation.fold import write_adapted
from perception.segmentation.adaptation.head import GroundHead, HeadConfig, agreement, fit_head
from perception.segmentation.adaptation.place_statement import (
    PlaceStatement,
    feature_statistics,
)
from perception.segmentation.adaptation.role_network import (
    OnnxRoleNetwork,
    RoleNetwork,
)
from perception.segmentation.geometry.labels import GroundLabels
from perception.segmentation.geometry.learn_labels import LabelConfig, ground_labels
from uav_bt.errors import FileError, InputError, WeightsError
from uav_bt.files import reading, write_whole, writing
from uav_bt.lab.classes import LabClasses
from uav_bt.lab.lab import LAB_FILE, NETWORK_FILE, Lab, check_lab_name
from uav_bt.lab.lab_file import read_lab
from uav_bt.lab.roles import ROLE_NAMES
from uav_bt.types import ClassMap, DepthMap, Frame

# With less agreement the labels contradict what the network can see.
_LEAST_AGREEMENT: Final = 0.8

_LAB_TEXT: Final = """\
# A place that a flight has learned by the motion of the ground between its frames. The file
# learned.yaml states for which camera, height and images: another place needs another flight.
version: 1

classes:
  outside: {role: outside, colour: "#282830"}
  ground: {role: ground, colour: "#7e9e78"}
  obstacle: {role: obstacle, colour: "#d62728"}
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class LearnedPlace:
    """Results of a flight that learned a place.

    Attributes:
        head: The adapted head.
        statement: For which camera, height and images it holds.
        labels: The labels from which it was learned.
    """

    head: GroundHead
    statement: PlaceStatement
    labels: tuple[GroundLabels, ...]


def learn_place(
    footage: Footage,
    network: RoleNetwork,
    *,
    base: str,
    made: str = "",
    labelling: LabelConfig | None = None,
    fitting: HeadConfig | None = None,
) -> LearnedPlace:
    """Learn which pixels are ground in a place.

    Args:
        footage: the flight, frames of at least 448x224 pixels; undistorted.
        network: the frozen network.
        base: hash of its file, for the statement.
        made: date and time for the statement; empty for none.
        labelling: how frames are labelled.
        fitting: how the head is fitted.

    Raises:
        InputError: the flight shows too little ground, or the network cannot follow the labels.
    """
    labels = ground_labels(footage, labelling)
    if not labels:
        raise InputError(
            "no frame of the flight has another at a distance: fly with steps to the side"
        )
    views = [network.infer(footage.frames[each.frame]) for each in labels]
    head = fit_head(views, labels, fitting)
    agreed = agreement(head, views, labels)
    if agreed < _LEAST_AGREEMENT:
        raise InputError(
            f"the network can follow only {agreed:.0%} of the labels, {_LEAST_AGREEMENT:.0%} are "
            "needed: the height above the ground may be wrong, or much moves in the room"
        )
    means, spread = feature_statistics(views)
    camera = footage.camera
    heights_m = [footage.height_above_ground_m[each.frame] for each in labels]
    statement = PlaceStatement(
        made=made,
        base=base,
        width_px=camera.width_px,
        height_px=camera.height_px,
        focal_px=(camera.fx_px, camera.fy_px),
        height_m=round(float(np.mean(heights_m)), 3),
        frames=len(labels),
        known_share=round(float(np.mean([each.known_share for each in labels])), 4),
        agreement=round(agreed, 4),
        feature_means=tuple(tuple(np.round(each, 4).tolist()) for each in means),
        feature_spread=tuple(np.round(spread, 5).tolist()),
    )
    return LearnedPlace(head=head, statement=statement, labels=tuple(labels))


def network_hash(path: Path) -> str:
    """Return the SHA-256 of a network's file.

    Raises:
        WeightsError: the file cannot be read.
    """
    with reading(path, WeightsError):
        return hashlib.sha256(path.read_bytes()).hexdigest()


def write_learned_lab(folder: Path, place: LearnedPlace, network: OnnxRoleNetwork) -> Lab:
    """Write the folder of a learned lab and return the lab.

    Args:
        folder: the new folder; its name is the lab's.
        place: results of the flight.
        network: the frozen network.

    Raises:
        InputError: the folder's name cannot be that of a lab.
        FileError: the folder exists or cannot be written.
        MissingDependencyError: the package onnx is not installed.
    """
    check_lab_name(folder.name)
    if folder.exists():
        raise FileError(folder, "exists: choose another name")
    with writing(folder):
        folder.mkdir(parents=True)
    base = place.statement.base
    write_adapted(folder / NETWORK_FILE, network.path, network.groups, place.head, base)
    place.statement.write(folder)
    write_whole(folder / LAB_FILE, _LAB_TEXT)
    return read_lab(folder)


class AdaptedSegmenter:
    """A network with its adapted head, as a segmenter in the flight that has learned the place.

    A network with a second head gives the relative depth of the frame, too.

    Args:
        network: the frozen network.
        head: the head.
        classes: classes of the flight's lab.

    Raises:
        InputError: the lab has no class for one of the roles.
    """

    def __init__(self, network: RoleNetwork, head: GroundHead, classes: LabClasses) -> None:
        self._network, self._head, self._classes = network, head, classes
        self._ids = np.array([_class_of(role, classes) for role in ROLES], np.uint8)
        self._depth: DepthMap | None = None

    @property
    def relative_depth(self) -> DepthMap | None:
        """Depth of the frame that was segmented last, in heights of the camera above the ground."""
        return self._depth

    def segment(self, frame: Frame) -> ClassMap:
        """Return the class map of a frame."""
        view = self._network.infer(frame.image)
        if view.depth is not None:
            self._depth = DepthMap(
                depth=view.depth, metric=False, captured_s=frame.captured_s, in_heights=True
            )
        ids = self._ids[self._head.scores(view).argmax(axis=0)]
        return ClassMap(ids=ids, classes=self._classes, captured_s=frame.captured_s)


def _class_of(role: str, classes: LabClasses) -> int:
    found = classes.of_role(ROLE_NAMES.index(role))
    standing = [each for each in found if each in classes.standing]
    if not found:
        raise InputError(f"the lab has no class of the role '{role}', in which a place is learned")
    return (standing or list(found))[0]
