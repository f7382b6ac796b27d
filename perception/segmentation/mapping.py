"""What a foreign segmentation network's classes mean here, and what its input wants.

A mapping is a YAML (or JSON) file beside the network:

.. code-block:: yaml

    input:                    # optional; each entry has a default
      mean: [0, 0, 0]         # taken from the 0..255 colours, red green blue
      scale: [255, 255, 255]  # then divided by these
      colours: rgb            # or bgr
      layout: nchw            # or nhwc
    default: background       # optional: what classes become that are not listed
    classes:                  # the network's class number: our class, or one of the four groups
      0: background
      5: obstacle
      11: carpet
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, Literal

import numpy as np
import yaml
from numpy.typing import NDArray

from uav_bt.classes import BACKGROUND, BOXES, CARPET, CLASS_NAMES, HELIPAD_BOX, class_id
from uav_bt.errors import FileError, UavBtError, ValueRangeError, did_you_mean

__all__ = ["GROUP_ALIASES", "ClassMapping", "InputFormat", "read_mapping"]

GROUP_ALIASES: Final[Mapping[str, int]] = MappingProxyType(
    {
        "background": BACKGROUND,
        "carpet": CARPET,
        "helipad": HELIPAD_BOX,
        "obstacle": BOXES[0],
    }
)
"""The class that stands for a group when a network does not tell its classes apart."""

_MOST_CLASSES: Final = 65536  # a class number beyond this is a mistake, not a network
_Triple = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class InputFormat:
    """How a network wants its picture."""

    mean: _Triple = (0.0, 0.0, 0.0)  # subtracted from the 0..255 colours, red green blue
    scale: _Triple = (255.0, 255.0, 255.0)  # divides the difference
    colours: Literal["rgb", "bgr"] = "rgb"
    layout: Literal["nchw", "nhwc"] = "nchw"

    def __post_init__(self) -> None:
        if len(self.mean) != 3 or len(self.scale) != 3 or 0.0 in self.scale:
            raise ValueRangeError(
                f"mean and scale need three numbers, scale none of them zero, got {self.mean}, "
                f"{self.scale}"
            )
        if self.colours not in ("rgb", "bgr") or self.layout not in ("nchw", "nhwc"):
            raise ValueRangeError(
                "colours must be rgb or bgr and layout nchw or nhwc, "
                f"got {self.colours}, {self.layout}"
            )


@dataclass(frozen=True, kw_only=True)
class ClassMapping:
    """A network's class numbers in our class ids."""

    classes: Mapping[int, int]  # theirs to ours
    default: int = BACKGROUND  # ours, for theirs that are not listed
    input: InputFormat = field(default_factory=InputFormat)

    def __post_init__(self) -> None:
        if not self.classes:
            raise ValueRangeError("a class mapping must list at least one class")
        for theirs in self.classes:
            if not 0 <= theirs < _MOST_CLASSES:
                raise ValueRangeError(f"a class number must lie within 0 and 65535, got {theirs}")

    @staticmethod
    def identity() -> ClassMapping:
        """Return the mapping of a network that speaks our seventeen classes."""
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
        FileError: the file is absent or malformed; the message says what was expected.
    """
    try:
        text = path.read_text(encoding="utf-8")
        content = yaml.safe_load(text)
    except FileNotFoundError as error:
        raise FileError(path, "there is no such class mapping") from error
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else None
        raise FileError(path, f"is not YAML: {error.problem}", line=line) from error
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise FileError(path, f"cannot be read as a class mapping ({error})") from error
    try:
        return _parse(content)
    except UavBtError as error:
        raise FileError(path, str(error)) from error


def _parse(content: Any) -> ClassMapping:
    top = _section(content, "a class mapping", {"input", "default", "classes"})
    classes = top.get("classes")
    if not isinstance(classes, dict):
        raise ValueRangeError("'classes' must list class numbers and their names")
    ours: dict[int, int] = {}
    for theirs, name in classes.items():
        # JSON has no numbers as keys, so digits in quotes are as good.
        number = int(theirs) if isinstance(theirs, str) and theirs.isdecimal() else theirs
        if not isinstance(number, int) or isinstance(number, bool):
            raise ValueRangeError(f"a class number must be whole, got '{theirs}'")
        ours[number] = _named(name)
    return ClassMapping(
        classes=ours,
        default=_named(top.get("default", "background")),
        input=_input(top.get("input", {})),
    )


def _input(content: Any) -> InputFormat:
    section = _section(content, "'input'", {"mean", "scale", "colours", "layout"})
    for key in ("mean", "scale"):
        if key in section:
            values = section[key]
            if not isinstance(values, list) or not all(isinstance(v, int | float) for v in values):
                raise ValueRangeError(f"'{key}' must be a list of three numbers, got {values}")
            section[key] = tuple(float(value) for value in values)
    return InputFormat(**section)


def _section(content: Any, name: str, known: set[str]) -> dict[str, Any]:
    if not isinstance(content, dict):
        raise ValueRangeError(f"{name} must be a YAML mapping, got {type(content).__name__}")
    for key in content:
        if key not in known:
            raise ValueRangeError(f"{name} knows no '{key}'{did_you_mean(str(key), known)}")
    return dict(content)


def _named(name: Any) -> int:
    alias = GROUP_ALIASES.get(name) if isinstance(name, str) else None
    return class_id(str(name)) if alias is None else alias
