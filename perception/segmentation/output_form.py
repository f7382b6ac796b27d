"""Forms of a segmentation network's output: class scores, class numbers or one class."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum, auto

from perception.segmentation.mapping import ClassMapping
from uav_bt.errors import ValueRangeError


class OutputForm(Enum):
    """Kind and layout of a network's output."""

    SCORES_FIRST = auto()  # 1xCxHxW: a score for each class
    SCORES_LAST = auto()  # 1xHxWxC: a score for each class
    NUMBERS = auto()  # 1xHxW or one channel: the number of the class
    ONE_CLASS = auto()  # 1xHxW or one channel: probability or score of class 0


def output_form(
    shape: Sequence[int], size_px: tuple[int, int], mapping: ClassMapping, *, whole_numbers: bool
) -> OutputForm:
    """Return the form of an output of this shape.

    Scores come before or after rows and columns. Rows and columns are recognised by the aspect
    ratio of the input. If both layouts fit, the class list decides: the mapping must not name a
    class that the network does not have.

    Args:
        shape: shape of the output; the first number is the batch, 1.
        size_px: width and height of the network's input.
        mapping: mapping of the network's classes.
        whole_numbers: whether the output's elements are integers.

    Raises:
        ValueRangeError: the shape fits no form, or the place of the scores is unclear.
    """
    if len(shape) not in (3, 4) or shape[0] != 1:
        raise ValueRangeError(f"the output must be 1xCxHxW, 1xHxWxC or 1xHxW, got {_sizes(shape)}")
    if len(shape) == 3 or 1 in (shape[1], shape[3]):
        one = set(mapping.classes) == {0} and not whole_numbers
        return OutputForm.ONE_CLASS if one else OutputForm.NUMBERS
    if mapping.output is not None:
        return OutputForm.SCORES_FIRST if mapping.output == "nchw" else OutputForm.SCORES_LAST
    places = {OutputForm.SCORES_FIRST: (1, 2, 3), OutputForm.SCORES_LAST: (3, 1, 2)}
    width_px, height_px = size_px
    off = {
        form: abs(shape[rows] * width_px - shape[columns] * height_px)
        for form, (_, rows, columns) in places.items()
    }
    # An exact fit is preferred to one with both sizes rounded, each by less than a pixel.
    fitting = [form for form in places if off[form] == 0] or [
        form for form in places if off[form] < width_px + height_px
    ]
    if len(fitting) > 1:
        highest = max(mapping.classes)
        fitting = [form for form in fitting if highest < shape[places[form][0]]]
    if len(fitting) == 1:
        return fitting[0]
    raise ValueRangeError(
        f"the output {_sizes(shape)} does not show whether classes come before or after rows and "
        "columns; add `output: nchw` or `output: nhwc` to the network's mapping file"
    )


def _sizes(shape: Sequence[int]) -> str:
    return "x".join(map(str, shape))
