"""Detection of checkerboards in photographs: layout and positions of the inner corners."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from typing import Final

import cv2
import numpy as np

from uav_bt.errors import FileError, InputError
from uav_bt.protocols import Advance
from uav_bt.types.arrays import Floats32, Image

Corners = Floats32  # (rows, columns, 2): image column and row of each corner, px
Photographs = Mapping[str, Callable[[], Image]]  # by name, functions that return (H, W) grey

MIN_CORNERS: Final = 12  # 4x3: fewer add little information to the board's four corners
_SEARCH_PX: Final = 1280  # larger images are searched at this longest side, refined at full size
# Layouts from which the search grows a board. Clutter often contains the small layout, so the
# larger goes first.
_SEEDS: Final = ((7, 5), (4, 3))


def find_boards(
    photographs: Photographs, advance: Advance
) -> tuple[dict[str, Corners], tuple[int, int], dict[str, str]]:
    """Find the boards of many photographs of one camera; those of an unusual size are left out.

    Returned are boards by photograph, width and height of the photographs, and reasons by unusable
    photograph. InputError if no photograph can be read.
    """
    boards, unusable, shapes = dict[str, Corners](), dict[str, str](), dict[str, tuple[int, ...]]()
    for done, (name, read) in enumerate(photographs.items(), start=1):
        try:
            image = read()
        except FileError as error:
            unusable[name] = str(error)
            continue
        shapes[name] = image.shape
        if (found := find_any_board(image)) is not None:
            boards[name] = found
        advance("boards", done, len(photographs))
    if not shapes:
        reason = next(iter(unusable.values()), "there are none")
        raise InputError(f"none of {len(photographs)} photographs can be read: {reason}")
    most = height_px, width_px = Counter(shapes.values()).most_common(1)[0][0]
    for name, shape in shapes.items():
        if shape != most:
            boards.pop(name, None)
            given, usual = (f"{columns}x{rows}" for rows, columns in (shape, most))
            unusable[name] = f"is {given}, most photographs are {usual} (width x height)"
    usable = {name: read for name, read in photographs.items() if name not in unusable}
    _look_again(usable, boards, advance)
    return boards, (width_px, height_px), unusable


def _look_again(photographs: Photographs, boards: dict[str, Corners], advance: Advance) -> None:
    """Search for the commonest layout, which succeeds more often, where less of it was found."""
    votes = Counter(grid.shape[:2] for grid in boards.values())
    agreed = [layout for layout, count in votes.items() if count > 1]
    if not agreed:
        return
    rows, columns = max(agreed, key=lambda layout: (votes[layout], layout[0] * layout[1]))
    less = [name for name in photographs if not shows(boards.get(name), columns, rows)]
    for done, name in enumerate(less, start=1):
        whole = find_board(photographs[name](), columns, rows)
        if whole is not None and shows(whole, columns, rows):
            boards[name] = whole
        advance("boards again", done, len(less))


def shows(grid: Corners | None, columns: int, rows: int) -> bool:
    """Return whether a board has at least `columns` x `rows` inner corners."""
    return grid is not None and grid.shape[0] >= rows and grid.shape[1] >= columns


def find_any_board(image: Image) -> Corners | None:
    """Find the largest part of a board of unknown layout with all corners visible.

    It has at least as many columns as rows; None without a board.
    """
    small, shrink = _searchable(image)
    best: Corners | None = None
    for seed in _SEEDS:
        flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_LARGER
        found, points, meta = cv2.findChessboardCornersSBWithMeta(small, seed, flags)
        if not found:
            continue
        rows, columns = meta.shape[:2]
        grid = np.asarray(points, dtype=np.float32).reshape(rows, columns, 2)
        if best is None or grid.size > best.size:
            best = grid
        if best.size > 2 * 2 * seed[0] * seed[1]:
            break  # grown to twice the seed, so it cannot be clutter
    return None if best is None else _refined(image, best, shrink)


def find_board(image: Image, columns: int, rows: int) -> Corners | None:
    """Find a board with `columns` inner corners along its longer side, all visible."""
    small, shrink = _searchable(image)
    for flags in (0, cv2.CALIB_CB_EXHAUSTIVE):
        found, points = cv2.findChessboardCornersSB(small, (columns, rows), flags=flags)
        if found:
            grid = np.asarray(points, dtype=np.float32).reshape(rows, columns, 2)
            return _refined(image, grid, shrink)
    return None


def _searchable(image: Image) -> tuple[Image, float]:
    """Return the image shrunk for the search, and the factor by which it was shrunk."""
    longest = max(image.shape)
    if longest <= _SEARCH_PX:
        return image, 1.0
    shrink = longest / _SEARCH_PX
    size = round(image.shape[1] / shrink), round(image.shape[0] / shrink)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8), shrink


def _refined(image: Image, grid: Corners, shrink: float) -> Corners | None:
    """Refine corners to subpixel accuracy in the full image; None with too few corners in it.

    It is turned to at least as many columns as rows, and not mirrored. Refining is needed even
    without shrinking: the search is biased to one side, in the twin by half a pixel.
    """
    full = (grid + 0.5) * np.float32(shrink) - np.float32(0.5)
    # The search guesses corners beyond the image: their columns or rows are left out.
    last_px = np.array(image.shape[::-1]) - 1
    inside = np.all((full >= 0.0) & (full <= last_px), axis=-1)
    columns, rows = inside.all(axis=0), inside.all(axis=1)
    full = full[:, columns] if columns.mean() >= rows.mean() else full[rows]
    if full.size < 2 * MIN_CORNERS:
        return None
    if full.shape[0] > full.shape[1]:
        full = np.rot90(full)
    along, down = full[0, -1] - full[0, 0], full[-1, 0] - full[0, 0]
    if along[0] * down[1] - along[1] * down[0] < 0.0:
        full = full[:, ::-1]
    steps_px = [np.linalg.norm(np.diff(full, axis=axis), axis=-1).min() for axis in (0, 1)]
    # The window must not reach the neighbouring corners.
    reach = int(np.clip(round(0.35 * float(min(steps_px))), 2, 15))
    ends = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 40, 1e-3)
    corners = np.ascontiguousarray(full.reshape(-1, 1, 2))
    placed = cv2.cornerSubPix(image, corners, (reach, reach), (-1, -1), ends)
    return np.asarray(placed, dtype=np.float32).reshape(full.shape)
