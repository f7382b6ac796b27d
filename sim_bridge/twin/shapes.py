"""Parts of a kind of object: upright boxes and cylinders, in the axes of the object.

The drawn surfaces, the contacts, the rays of the drone without images and the ground computations
all come from these parts, or from the triangles of a mesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin.movers import Point
from uav_bt.lab.obj_file import pieces
from uav_bt.lab.room import ObjectKind

_OVERHANG_M: Final = 0.05  # of a table's top over its legs, if it is large enough; chosen
_INSET_M: Final = 0.004  # of shelves within their posts, so that no two faces lie in one plane
_LOWEST_SHELF_M: Final = 0.12  # upper side of a rack's lowest shelf
_BELOW_POSTS_M: Final = 0.02  # of a rack's highest shelf


@dataclass(frozen=True, kw_only=True)
class Part:
    """An upright box or cylinder of an object.

    Attributes:
        centre_m: Its centre seen from above, from the object's centre.
        half_m: Half length and half width; of a cylinder the radius, twice.
        base_m: Height of its underside.
        top_m: Height of its upper side.
        round: Whether it is a cylinder.
        frame: Whether it is a leg or a post.
        roofed: Whether its upper side has the class and look of the object's top.
    """

    centre_m: Point = (0.0, 0.0)
    half_m: Point
    base_m: float = 0.0
    top_m: float
    round: bool = False
    frame: bool = False
    roofed: bool = False


def parts_of(kind: ObjectKind, mesh: NDArray[np.float64] | None = None) -> tuple[Part, ...]:
    """Return the parts of a kind; of a mesh the boxes around its connected pieces.

    Args:
        kind: The kind.
        mesh: (N, 3, 3) triangles of a mesh.
    """
    length_m, width_m, height_m = kind.size_m
    half_m = (length_m / 2, width_m / 2)
    if mesh is not None:
        return tuple(_around(piece) for piece in pieces(mesh))
    if kind.shape == "table":
        return _table(kind)
    if kind.shape == "rack":
        return _rack(kind)
    return (Part(half_m=half_m, top_m=height_m, round=kind.shape == "cylinder", roofed=True),)


def _table(kind: ObjectKind) -> tuple[Part, ...]:
    length_m, width_m, height_m = kind.size_m
    below_m = height_m - kind.board_m
    inset_m = min(_OVERHANG_M, min(length_m, width_m) / 2 - kind.post_m)
    board = Part(half_m=(length_m / 2, width_m / 2), base_m=below_m, top_m=height_m, roofed=True)
    return (board, *_legs(kind, inset_m, below_m))


def _rack(kind: ObjectKind) -> tuple[Part, ...]:
    length_m, width_m, height_m = kind.size_m
    half_m = (length_m / 2 - _INSET_M, width_m / 2 - _INSET_M)
    lowest_m = max(_LOWEST_SHELF_M, kind.board_m) if kind.shelves > 1 else height_m
    tops_m = np.linspace(min(lowest_m, height_m), height_m, kind.shelves) - _BELOW_POSTS_M
    shelves = (
        Part(
            half_m=half_m,
            base_m=max(float(top_m) - kind.board_m, 0.0),
            top_m=float(top_m),
            roofed=index == kind.shelves - 1,
        )
        for index, top_m in enumerate(tops_m)
    )
    return (*shelves, *_legs(kind, 0.0, height_m))


def _legs(kind: ObjectKind, inset_m: float, top_m: float) -> tuple[Part, ...]:
    """Return four legs at the corners, moved inwards."""
    half_m = kind.post_m / 2
    x_m, y_m = (side / 2 - inset_m - half_m for side in kind.size_m[:2])
    return tuple(
        Part(centre_m=(sx * x_m, sy * y_m), half_m=(half_m, half_m), top_m=top_m, frame=True)
        for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1))
    )


def _around(piece: NDArray[np.float64]) -> Part:
    low, high = piece.min(axis=(0, 1)), piece.max(axis=(0, 1))
    middle, half = (low + high) / 2, (high - low) / 2
    return Part(
        centre_m=(float(middle[0]), float(middle[1])),
        half_m=(float(half[0]), float(half[1])),
        base_m=float(low[2]),
        top_m=float(high[2]),
    )
