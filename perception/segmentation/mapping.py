"""Mapping file of a foreign segmentation network: meaning of its classes, format of its input.

A mapping is a YAML (or JSON) file beside the network:

.. code-block:: yaml

    input:                    # optional; each entry has a default
      mean: [0, 0, 0]         # taken from the 0..255 colours, red green blue
      scale: [255, 255, 255]  # then divided by these; 1 by default for an input of whole numbers
      colours: rgb            # or bgr
      layout: nchw            # or nhwc
      size: [224, 112]        # width, height; where the file leaves them open
    output: nchw              # or nhwc; where the sizes do not show it
    threshold: 0.5            # of a network of one class, class 0; other pixels become the default
    default: outside          # optional: what classes become that are not listed
    classes:                  # the network's class number: a class of the lab, or a role
      0: outside
      5: obstacle
      11: ground
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from perception.networks.input_format import InputFormat
from uav_bt.errors import UnknownNameError, ValueRangeError
from uav_bt.lab.classes import GROUND, LabClasses
from uav_bt.protocols import Segmenter
from uav_bt.types import ClassMap, Frame
from uav_bt.yaml_file import read_yaml

_MAX_CLASSES: Final = 65536  # larger class numbers are mistakes


def class_id_of(name: str, classes: LabClasses) -> int:
    """Return the id of a class, or that of the first suitable class of a role.

    A network may not distinguish the classes of a role. Its obstacles become the first class that
    stands on the ground, its landing mark becomes the sides of the mark.

    Args:
        name: Name of a class or of a role.
        classes: Classes of the lab.

    Raises:
        UnknownNameError: There is no such class or role.
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


@dataclass(frozen=True, kw_only=True)
class ClassMapping:
    """Mapping of a network's class numbers to the classes of a lab."""

    classes: Mapping[int, str]  # the network's class number -> our class or role
    default: str = "outside"  # our class or role for unlisted class numbers
    input: InputFormat = field(default_factory=InputFormat)
    output: Literal["nchw", "nhwc"] | None = None  # layout of scores; None: found from the sizes
    # Of the output of a network of one class. None: 0.5, and the output must be a probability.
    threshold: float | None = None

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

    def table(self, count: int, classes: LabClasses) -> NDArray[np.uint8]:
        """Return our class id of each of the network's classes.

        Args:
            count: number of the network's classes.
            classes: classes of the lab.

        Raises:
            ValueRangeError: the mapping names a class the network does not have.
            UnknownNameError: the lab does not have a class.
        """
        beyond = [number for number in self.classes if number >= count]
        if beyond:
            raise ValueRangeError(
                f"the mapping names class {max(beyond)}, the network has classes 0 to {count - 1}"
            )
        table = np.full(count, class_id_of(self.default, classes), dtype=np.uint8)
        for theirs, ours in self.classes.items():
            table[theirs] = class_id_of(ours, classes)
        return table


def read_mapping(path: Path, classes: LabClasses) -> ClassMapping:
    """Read a mapping file.

    Args:
        path: the file.
        classes: classes of the lab.

    Raises:
        FileError: the file is absent or malformed, or the lab does not have a class.
    """
    file = read_yaml(path, ClassMapping, "class mapping")
    for name, *steps in (
        (file.value.default, "default"),
        *((ours, "classes", theirs) for theirs, ours in file.value.classes.items()),
    ):
        try:
            class_id_of(str(name), classes)
        except UnknownNameError as error:
            raise file.error(str(error), *steps) from error
    return file.value


class CountedAsGround:
    """A segmenter that replaces further classes with the ground of the lab.

    Args:
        segmenter: gives the classes.
        classes: classes of the lab.
        ground: names of the classes over which a drone may fly and by which depth is scaled.

    Raises:
        UnknownNameError: a name is not that of a class.
    """

    def __init__(self, segmenter: Segmenter, classes: LabClasses, ground: Iterable[str]) -> None:
        self._segmenter = segmenter
        self._table = np.arange(256, dtype=np.uint8)
        self._table[[classes.id_of(name) for name in ground]] = classes.ground

    def segment(self, frame: Frame) -> ClassMap:
        """Return the class map with the further classes as ground."""
        class_map = self._segmenter.segment(frame)
        return replace(class_map, ids=self._table[class_map.ids])
