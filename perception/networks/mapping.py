"""Mapping files of foreign networks: meaning of the output, and format of the input image.

A mapping is a YAML (or JSON) file. That of a segmentation network is named in the tree or site:

.. code-block:: yaml

    input:                    # optional; each entry has a default
      mean: [0, 0, 0]         # taken from the 0..255 colours, red green blue
      scale: [255, 255, 255]  # then divided by these; 1 by default for an input of whole numbers
      colours: rgb            # or bgr
      layout: nchw            # or nhwc
      size: [224, 112]        # width, height; where the file leaves them open
    output: nchw              # or nhwc; where the sizes do not show it
    default: outside          # optional: what classes become that are not listed
    classes:                  # the network's class number: a class of the lab, or a role
      0: outside
      5: obstacle
      11: ground

That of a depth network has its name, `net.yaml` beside `net.onnx`. It has `input` as above, and
`output`: `depth` or `disparity` (1/depth, as of MiDaS and Depth Anything).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, Literal

import numpy as np

from uav_bt.errors import UnknownNameError, ValueRangeError
from uav_bt.lab.classes import GROUND, LabClasses
from uav_bt.protocols import Segmenter
from uav_bt.types import ClassMap, Frame
from uav_bt.types.arrays import Ids
from uav_bt.yaml_file import read_yaml

_MAX_CLASSES: Final = 65536  # larger class numbers are mistakes


@dataclass(frozen=True, kw_only=True)
class InputFormat:
    """Format of the image that a network takes."""

    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    # None: 255 for an input of floats, 1 for one of whole numbers, which scales inside.
    scale: tuple[float, float, float] | None = None
    colours: Literal["rgb", "bgr"] = "rgb"
    layout: Literal["nchw", "nhwc"] = "nchw"
    size: tuple[int, int] | None = None  # width and height in px, if the ONNX file leaves them open

    def __post_init__(self) -> None:
        if 0.0 in (self.scale or ()) or min(self.size or (1,)) < 1:
            raise ValueRangeError(
                "scale must have three numbers, none of them zero, and size must be a width and a "
                f"height in px, got {self.scale} and {self.size}"
            )


@dataclass(frozen=True, kw_only=True)
class ClassMapping:
    """Mapping of a network's class numbers to the classes of a lab."""

    classes: Mapping[int, str]  # the network's class number -> our class or role
    default: str = "outside"  # our class or role for unlisted class numbers
    input: InputFormat = field(default_factory=InputFormat)
    output: Literal["nchw", "nhwc"] | None = None  # layout of scores; None: found from the sizes

    def __post_init__(self) -> None:
        if not self.classes:
            raise ValueRangeError("a class mapping must list at least one class")
        for theirs in self.classes:
            if not 0 <= theirs < _MAX_CLASSES:
                raise ValueRangeError(f"a class number must lie within 0 and 65535, got {theirs}")

    @staticmethod
    def identity(classes: LabClasses) -> ClassMapping:
        """Return the mapping of a network with the classes of the lab."""
        return ClassMapping(classes=dict(enumerate(classes.names)))

    def table(self, count: int, classes: LabClasses) -> Ids:
        """Return our class id of each of the network's `count` classes; all must be known."""
        most = max(self.classes)
        if most >= count:
            known = f"the network has classes 0 to {count - 1}"
            raise ValueRangeError(f"the mapping names class {most}, {known}")
        table = np.full(count, class_id_of(self.default, classes), dtype=np.uint8)
        for theirs, ours in self.classes.items():
            table[theirs] = class_id_of(ours, classes)
        return table


@dataclass(frozen=True, kw_only=True)
class DepthMapping:
    """Meaning of a depth network's output, and the format of its input image."""

    output: Literal["depth", "disparity"]  # along the optical axis; 1/depth, both up to a factor
    input: InputFormat = field(default_factory=InputFormat)


def class_id_of(name: str, classes: LabClasses) -> int:
    """Return the id of a class, or that of the first suitable class of a role.

    Obstacles become the first class that stands on the ground, a landing mark the mark's sides.
    """
    if name in classes.names:
        return classes.id_of(name)
    of_role = {
        "outside": (0,),
        "ground": classes.of_role(GROUND),
        "mark": [each for each in (classes.mark_sides, classes.mark_top) if each is not None],
        "obstacle": classes.standing,
    }
    if not of_role.get(name):
        names = (*classes.names, *(role for role, ids in of_role.items() if ids))
        raise UnknownNameError("class or role", name, names)
    return of_role[name][0]


def read_mapping(path: Path, classes: LabClasses) -> ClassMapping:
    """Read the mapping file of a segmentation network; its classes must be those of the lab."""
    file = read_yaml(path, ClassMapping, "class mapping")
    with file.at("default"):
        class_id_of(file.value.default, classes)
    for theirs, ours in file.value.classes.items():
        with file.at("classes", theirs):
            class_id_of(ours, classes)
    return file.value


def read_depth_mapping(network: Path) -> DepthMapping | None:
    """Return the mapping beside a depth network; None if there is no such file."""
    path = network.with_suffix(".yaml")
    if not path.is_file():
        return None
    return read_yaml(path, DepthMapping, "mapping of a depth network").value


class CountedAsGround:
    """A segmenter that replaces further classes of a lab, given by name, with its ground."""

    def __init__(self, segmenter: Segmenter, classes: LabClasses, ground: Iterable[str]) -> None:
        self._segmenter = segmenter
        self._table = np.arange(256, dtype=np.uint8)
        self._table[[classes.id_of(name) for name in ground]] = classes.ground

    def segment(self, frame: Frame) -> ClassMap:
        """Return the class map with the further classes as ground."""
        class_map = self._segmenter.segment(frame)
        return replace(class_map, ids=self._table[class_map.ids])
