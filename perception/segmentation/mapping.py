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
    default: background       # optional: what classes become that are not listed
    classes:                  # the network's class number: our class, or one of the four groups
      0: background
      5: obstacle
      11: carpet
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import PlainValidator

from perception.networks.input_format import InputFormat
from uav_bt.classes import BACKGROUND, BOXES, CARPET, CLASS_NAMES, HELIPAD_BOX, class_id
from uav_bt.errors import ValueRangeError
from uav_bt.protocols import Segmenter
from uav_bt.types import ClassMap, Frame
from uav_bt.yaml_file import read_yaml

GROUP_ALIASES: Final[Mapping[str, int]] = MappingProxyType(
    {
        "background": BACKGROUND,
        "carpet": CARPET,
        "helipad": HELIPAD_BOX,
        "obstacle": BOXES[0],
    }
)
"""The class used for a group when a network does not distinguish the group's classes."""

_MAX_CLASSES: Final = 65536  # larger class numbers are mistakes


def _class_of(name: object) -> int:
    alias = GROUP_ALIASES.get(name) if isinstance(name, str) else None
    return class_id(str(name)) if alias is None else alias


_OurClass = Annotated[int, PlainValidator(_class_of)]  # files have names


@dataclass(frozen=True, kw_only=True)
class ClassMapping:
    """Mapping of a network's class numbers to our class ids."""

    classes: Mapping[int, _OurClass]  # the network's class number -> our class id
    default: _OurClass = BACKGROUND  # our class id for unlisted class numbers
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
    def identity() -> ClassMapping:
        """Return the mapping of a network with our seventeen classes."""
        return ClassMapping(classes={number: number for number in range(len(CLASS_NAMES))})

    def table(self, count: int) -> NDArray[np.uint8]:
        """Return our class id of each of the network's `count` classes.

        Raises:
            ValueRangeError: the mapping names a class the network does not have.
        """
        beyond = [number for number in self.classes if number >= count]
        if beyond:
            raise ValueRangeError(
                f"the mapping names class {max(beyond)}, the network has classes 0 to {count - 1}"
            )
        table = np.full(count, self.default, dtype=np.uint8)
        for theirs, ours in self.classes.items():
            table[theirs] = ours
        return table


def read_mapping(path: Path) -> ClassMapping:
    """Read a mapping file.

    Raises:
        FileError: the file is absent or malformed.
    """
    return read_yaml(path, ClassMapping, "class mapping").value


class CountedAsCarpet:
    """A segmenter that replaces all classes of ground with carpet, the ground of missions.

    Args:
        segmenter: gives the classes.
        ground: names of the classes over which a drone may fly and by which depth is scaled.

    Raises:
        UnknownNameError: a name is not that of a class.
    """

    def __init__(self, segmenter: Segmenter, ground: Iterable[str]) -> None:
        self._segmenter = segmenter
        self._table = np.arange(256, dtype=np.uint8)
        self._table[[class_id(name) for name in ground]] = CARPET

    def segment(self, frame: Frame) -> ClassMap:
        """Return the class map with ground as carpet."""
        class_map = self._segmenter.segment(frame)
        return replace(class_map, ids=self._table[class_map.ids])
