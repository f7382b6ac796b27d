"""The tags of a landing mark: family, numbers, sizes and places on the mark's top."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, NamedTuple, Self

import cv2
import numpy as np
from pydantic import Field, model_validator

from uav_bt.errors import UnknownNameError, ValueRangeError
from uav_bt.landing_marks import Options, read_options
from uav_bt.types import LandingMark
from uav_bt.types.arrays import Floats, Image

APRILTAG_FAMILIES: Final[Mapping[str, int]] = {  # the first is the usual one
    "36h11": cv2.aruco.DICT_APRILTAG_36h11,
    "16h5": cv2.aruco.DICT_APRILTAG_16h5,
    "25h9": cv2.aruco.DICT_APRILTAG_25h9,
    "36h10": cv2.aruco.DICT_APRILTAG_36h10,
}
ARUCO_FAMILIES: Final[Mapping[str, int]] = {
    f"{bits}x{bits}_{count}": getattr(cv2.aruco, f"DICT_{bits}X{bits}_{count}")
    for bits in (4, 5, 6, 7)
    for count in (50, 100, 250, 1000)
} | {"original": cv2.aruco.DICT_ARUCO_ORIGINAL, "mip_36h12": cv2.aruco.DICT_ARUCO_MIP_36h12}


_Number = Annotated[int, Field(ge=0)]
_Side = Annotated[float, Field(gt=0.0)]


class Tag(Options):
    """One tag of a board."""

    id: _Number  # in its family
    size_m: _Side  # side of its black square
    # Its middle from the middle of the mark: to the right, and towards the upper edge
    at_m: Annotated[tuple[float, float], Field(strict=False)] = (0.0, 0.0)

    def corners_m(self) -> Floats:
        """Return the corners on the mark's top, (4, 3), in OpenCV's order from the upper left."""
        square = np.array([(-1, 1, 0), (1, 1, 0), (1, -1, 0), (-1, -1, 0)]) * (self.size_m / 2.0)
        return np.asarray(square + np.array([*self.at_m, 0.0]))


class TagOptions(Options):
    """One tag, `{family: 36h11, id: 7, size_m: 0.3}`, or several, `{tags: [{id: 0, ...}, ...]}`."""

    family: str = ""
    id: _Number = 0
    size_m: _Side = 0.0
    tags: Annotated[tuple[Tag, ...], Field(strict=False)] = ()

    @model_validator(mode="after")
    def _one_or_several(self) -> Self:
        given = self.model_fields_set - {"family", "print"}
        if given != {"id", "size_m"} and not (given == {"tags"} and self.tags):
            raise ValueError(
                "needs the option id, the number of the tag in its family, and the option size_m, "
                "the side of its black square in metres; or several tags in the option tags"
            )
        return self


class AprilTagOptions(TagOptions):
    """As `TagOptions`, and who drew the prints: AprilTag and most generators, or OpenCV.

    The AprilTag dictionaries of OpenCV before 5.0.1, which pyproject.toml asks for, are turned by
    half a turn against AprilTag's own images (github.com/opencv/opencv/pull/28823).
    """

    print: Literal["apriltag", "opencv"] = "apriltag"


class TagBoard(NamedTuple):
    """The tags of a landing mark; all are upright on it."""

    tags: tuple[Tag, ...]
    dictionary: Any  # cv2.aruco.Dictionary of these tags alone, in their order
    cells: int  # along the side of a tag, its black border included


def read_board(mark: LandingMark, families: Mapping[str, int], form: type[TagOptions]) -> TagBoard:
    """Return the tags that the options of a landing mark describe.

    Raises an InputError for an unknown family, and for an option or a tag that does not fit.
    """
    options = read_options(mark, form)
    family = options.family or next(iter(families))
    if family not in families:
        raise UnknownNameError(f"family of landing mark '{mark.kind}'", family, families)
    whole = cv2.aruco.getPredefinedDictionary(families[family])
    tags = options.tags or (Tag(id=options.id, size_m=options.size_m),)
    count, cells = len(whole.bytesList), int(whole.markerSize) + 2
    for tag in tags:
        if tag.id >= count:
            raise ValueRangeError(f"family {family} has the tags 0 to {count - 1}, got id {tag.id}")
        if sum(tag.id == other.id for other in tags) > 1:
            raise ValueRangeError(f"tag {tag.id} is listed twice; each tag needs its own number")
        # A white margin of one cell around the black square makes the square detectable.
        half_m = tag.size_m * (0.5 + 1.0 / cells)
        for offset_m, side_m in zip(tag.at_m, mark.top_m, strict=True):
            if abs(offset_m) + half_m > side_m / 2.0 + 1e-9:
                raise ValueRangeError(
                    f"tag {tag.id} with its white margin of {tag.size_m / cells:.3f} m does not "
                    f"fit on a top of {mark.length_m:g} x {mark.width_m:g} m"
                )
    # Comparing with all 587 tags of 36h11 takes 30 ms a frame.
    codes = whole.bytesList[[tag.id for tag in tags]]
    if isinstance(options, AprilTagOptions) and options.print == "apriltag":
        bits = [whole.getBitsFromByteList(code[None], whole.markerSize) for code in codes]
        turned = [np.ascontiguousarray(each[::-1, ::-1]) for each in bits]
        codes = np.concatenate([whole.getByteListFromBits(each) for each in turned])
    own = cv2.aruco.Dictionary(codes, whole.markerSize, whole.maxCorrectionBits)
    return TagBoard(tags, own, cells)


def black_cells_m(board: TagBoard, index: int) -> Floats:
    """Return the corners of the black cells of a tag on the mark's top, (N, 4, 2)."""
    tag, cell_m = board.tags[index], board.tags[index].size_m / board.cells
    image = cv2.aruco.generateImageMarker(board.dictionary, index, board.cells)
    rows, columns = np.nonzero(image == 0)
    lower_left = np.stack([columns, board.cells - 1 - rows], axis=-1)[:, None]
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    return np.asarray((lower_left + square) * cell_m + np.array(tag.at_m) - tag.size_m / 2.0)


def draw_board(board: TagBoard, mark: LandingMark, px_per_m: float) -> Image:
    """Return the image of the mark's white top with its tags, (H, W, 3) RGB."""
    width_px, height_px = (round(side_m * px_per_m) for side_m in mark.top_m)
    image = np.full((height_px, width_px), 255, dtype=np.uint8)
    for index, tag in enumerate(board.tags):
        side_px = round(tag.size_m * px_per_m)
        fine = cv2.aruco.generateImageMarker(board.dictionary, index, 32 * board.cells)
        drawn = cv2.resize(fine, (side_px, side_px), interpolation=cv2.INTER_AREA)
        left = round((mark.length_m / 2.0 + tag.at_m[0]) * px_per_m - side_px / 2.0)
        upper = round((mark.width_m / 2.0 - tag.at_m[1]) * px_per_m - side_px / 2.0)
        image[upper : upper + side_px, left : left + side_px] = drawn
    return np.repeat(image[..., None], 3, axis=2)
