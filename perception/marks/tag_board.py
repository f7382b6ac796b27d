"""The tags of a landing mark: family, numbers, sizes and places on the mark's top."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.marks.mark_options import metres, refuse_unknown, whole_number
from uav_bt.errors import UnknownNameError, ValueRangeError
from uav_bt.types import LandingMark

APRILTAG_FAMILIES: Final[Mapping[str, int]] = {
    "16h5": cv2.aruco.DICT_APRILTAG_16h5,
    "25h9": cv2.aruco.DICT_APRILTAG_25h9,
    "36h10": cv2.aruco.DICT_APRILTAG_36h10,
    "36h11": cv2.aruco.DICT_APRILTAG_36h11,
}
ARUCO_FAMILIES: Final[Mapping[str, int]] = {
    **{
        f"{bits}x{bits}_{count}": getattr(cv2.aruco, f"DICT_{bits}X{bits}_{count}")
        for bits in (4, 5, 6, 7)
        for count in (50, 100, 250, 1000)
    },
    "original": cv2.aruco.DICT_ARUCO_ORIGINAL,
    "mip_36h12": cv2.aruco.DICT_ARUCO_MIP_36h12,
}
_ONE: Final = ("id", "size_m")
_OF_BOARD: Final = (*_ONE, "at_m")


@dataclass(frozen=True, kw_only=True)
class Tag:
    """One tag of a board.

    Attributes:
        id: Number in its family.
        size_m: Side of the black square, metres.
        at_m: Centre of the tag from the centre of the mark: to the right and towards the upper
            edge, metres.
    """

    id: int
    size_m: float
    at_m: tuple[float, float] = (0.0, 0.0)

    def corners_m(self) -> NDArray[np.float64]:
        """Return the corners on the mark's top, (4, 3), in OpenCV's order from the upper left."""
        half_m = self.size_m / 2.0
        square = np.array([(-1, 1, 0), (1, 1, 0), (1, -1, 0), (-1, -1, 0)]) * half_m
        return np.asarray(square + np.array([*self.at_m, 0.0]))


@dataclass(frozen=True, kw_only=True)
class TagBoard:
    """The tags of a landing mark.

    Attributes:
        family: Name of the family.
        dictionary: OpenCV's dictionary of the family.
        tags: The tags; all are upright on the mark.
    """

    family: str
    dictionary: Any  # cv2.aruco.Dictionary
    tags: tuple[Tag, ...]

    @property
    def cells(self) -> int:
        """The number of cells along the side of a tag, its black border included."""
        return int(self.dictionary.markerSize) + 2

    def own_dictionary(self) -> Any:
        """Return a cv2.aruco.Dictionary of these tags alone, in their order.

        Comparing with all 587 tags of 36h11 takes 30 ms a frame.
        """
        codes = self.dictionary.bytesList[[tag.id for tag in self.tags]]
        return cv2.aruco.Dictionary(
            codes, self.dictionary.markerSize, self.dictionary.maxCorrectionBits
        )


def read_board(mark: LandingMark, families: Mapping[str, int], usual: str) -> TagBoard:
    """Return the tags that the options of a landing mark describe.

    One tag: `{family: 36h11, id: 7, size_m: 0.3}`. A board:
    `{tags: [{id: 0, size_m: 0.2, at_m: [-0.12, 0.12]}, ...]}`.

    Args:
        mark: The landing mark.
        families: OpenCV's dictionaries by name.
        usual: Name of the family where the options do not state one.

    Raises:
        UnknownNameError: The family is unknown.
        ValueRangeError: An option is unknown, missing or out of range, or a tag does not fit.
    """
    given = dict(mark.options)
    listed = given.get("tags")
    refuse_unknown(mark, ("family", *_ONE, "tags"))
    if "tags" in given and any(name in given for name in _ONE):
        raise ValueRangeError(
            f"landing mark '{mark.kind}': give one tag by id and size_m, or several by tags"
        )
    family = given.get("family", usual)
    if family not in families:
        raise UnknownNameError(f"family of landing mark '{mark.kind}'", str(family), families)
    board = TagBoard(
        family=family,
        dictionary=cv2.aruco.getPredefinedDictionary(families[family]),
        tags=(_tag(mark, given, _ONE),) if "tags" not in given else _listed(mark, listed),
    )
    _check(mark, board)
    return board


def _listed(mark: LandingMark, listed: object) -> tuple[Tag, ...]:
    if not isinstance(listed, (list, tuple)) or not listed:
        raise ValueRangeError(f"option tags: expected a list of tags, got {listed!r}")
    tags = []
    for number, each in enumerate(listed):
        if not isinstance(each, Mapping):
            raise ValueRangeError(f"option tags[{number}]: expected a mapping, got {each!r}")
        refuse_unknown(mark, _OF_BOARD, each)
        tags.append(_tag(mark, each, _OF_BOARD, f"tags[{number}]."))
    return tuple(tags)


def _tag(
    mark: LandingMark, given: Mapping[str, Any], names: tuple[str, ...], where: str = ""
) -> Tag:
    for name in _ONE:
        if name not in given:
            raise ValueRangeError(
                f"landing mark '{mark.kind}' needs the option {where}{name}: the number of the tag "
                "in its family and the side of its black square in metres"
            )
    at = given.get("at_m", (0.0, 0.0)) if "at_m" in names else (0.0, 0.0)
    if not isinstance(at, (list, tuple)) or len(at) != 2:
        raise ValueRangeError(f"option {where}at_m: expected two numbers, got {at!r}")
    right_m, up_m = (metres(f"{where}at_m", value, signed=True) for value in at)
    return Tag(
        id=whole_number(f"{where}id", given["id"]),
        size_m=metres(f"{where}size_m", given["size_m"]),
        at_m=(right_m, up_m),
    )


def _check(mark: LandingMark, board: TagBoard) -> None:
    """Refuse tags that the family does not have, that come twice, or that do not fit on the top."""
    count = len(board.dictionary.bytesList)
    seen: set[int] = set()
    for tag in board.tags:
        if tag.id >= count:
            raise ValueRangeError(
                f"family {board.family} has the tags 0 to {count - 1}, got id {tag.id}"
            )
        if tag.id in seen:
            raise ValueRangeError(
                f"tag {tag.id} is listed twice; each tag needs a number of its own"
            )
        seen.add(tag.id)
        # A white margin of one cell around the black square makes the square detectable.
        half_m = tag.size_m * (0.5 + 1.0 / board.cells)
        for offset_m, side_m in zip(tag.at_m, mark.top_m, strict=True):
            if abs(offset_m) + half_m > side_m / 2.0 + 1e-9:
                raise ValueRangeError(
                    f"tag {tag.id} of {tag.size_m:g} m at {list(tag.at_m)}, with a white margin of "
                    f"{tag.size_m / board.cells:.3f} m, does not fit on a top of "
                    f"{mark.length_m:g} x {mark.width_m:g} m"
                )


def draw_board(board: TagBoard, mark: LandingMark, px_per_m: float) -> NDArray[np.uint8]:
    """Return the image of the mark's white top with its tags, (H, W, 3) RGB.

    Args:
        board: The tags.
        mark: Size of the top.
        px_per_m: Resolution, pixels per metre.
    """
    width_px, height_px = (round(side_m * px_per_m) for side_m in mark.top_m)
    image = np.full((height_px, width_px), 255, dtype=np.uint8)
    for tag in board.tags:
        side_px = round(tag.size_m * px_per_m)
        fine = cv2.aruco.generateImageMarker(board.dictionary, tag.id, 32 * board.cells)
        drawn = cv2.resize(fine, (side_px, side_px), interpolation=cv2.INTER_AREA)
        left = round((mark.length_m / 2.0 + tag.at_m[0]) * px_per_m - side_px / 2.0)
        upper = round((mark.width_m / 2.0 - tag.at_m[1]) * px_per_m - side_px / 2.0)
        image[upper : upper + side_px, left : left + side_px] = drawn
    return np.repeat(image[..., None], 3, axis=2)
