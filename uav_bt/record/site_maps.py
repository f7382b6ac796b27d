"""A site map as a record's message and back: its grids as one image, the rest as numbers.

The image has one byte per cell and one bit per grid. It keeps whether a cell showed ground, but not
when.
"""

from __future__ import annotations

import base64
import binascii
from dataclasses import fields
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import InputError
from uav_bt.lab.classes import LabClasses
from uav_bt.record.channels import SiteMapNote
from uav_bt.record.images import decode_bytes, encode_bytes
from uav_bt.types import Pose2D
from uav_bt.types.site_map import MapMark, MapMover, MapObject, SiteMap, SiteMapBase

_GROUND, _FREE, _OUTSIDE, _PASSED = 1, 2, 4, 8  # bits of a cell
_DECIMALS: Final = 3  # decimal places of points in metres
_FAR_M: Final = 1e4  # largest coordinate that is accepted, m


def note_of(site_map: SiteMap) -> SiteMapNote:
    """Return the note of a map."""
    cells = np.zeros(site_map.free.shape, dtype=np.uint8)
    for grid, bit in _grids(site_map):
        cells[grid] |= bit
    kept = {item.name: getattr(site_map, item.name) for item in fields(SiteMapBase)}
    for name in ("obstacles_m", "edges_m", "lanes_m"):
        kept[name] = kept[name].round(_DECIMALS)
    cells_png = base64.b64encode(encode_bytes(cells)).decode("ascii")
    return SiteMapNote(cells_png=cells_png, **kept)


def _grids(site_map: SiteMap) -> tuple[tuple[NDArray[np.bool_], int], ...]:
    ground, free = (site_map.ground, _GROUND), (site_map.free, _FREE)
    return ground, free, (site_map.outside, _OUTSIDE), (site_map.passed, _PASSED)


def site_map_of(note: SiteMapNote, classes: LabClasses) -> SiteMap:
    """Return the map of a note; InputError if it is none.

    All its ground gets the capture time of the newest frame.
    """
    try:
        cells = decode_bytes(base64.b64decode(note.cells_png, validate=True))
    except binascii.Error as error:
        raise InputError(f"the cells of a site map are damaged: {error}") from error
    _check(note, classes)
    return SiteMap(
        classes=classes,
        seen_s=np.where(cells & _GROUND, note.captured_s, -np.inf),
        free=(cells & _FREE) > 0,
        outside=(cells & _OUTSIDE) > 0,
        passed=(cells & _PASSED) > 0,
        **{item.name: getattr(note, item.name) for item in fields(SiteMapBase)},
    )


def _check(note: SiteMapNote, classes: LabClasses) -> None:
    """Refuse values that cannot be drawn."""
    if len(note.corner_m) != 2 or not 0.0 < note.cell_m < _FAR_M:
        raise InputError(f"a site map of cells of {note.cell_m} m at {note.corner_m} is none")
    for points_m in (note.obstacles_m, note.edges_m, note.lanes_m):
        if points_m.ndim != 2 or points_m.shape[1] != 2:
            raise InputError(f"expected (N, 2) points of a site map, got {points_m.shape}")
    things: list[Pose2D | MapObject | MapMark | MapMover]
    things = [note.pose, note.start, *note.objects, *note.movers]
    things += [] if note.mark is None else [note.mark]
    places_m = np.array([note.corner_m, *((thing.x_m, thing.y_m) for thing in things)])
    for some_m in (places_m, note.obstacles_m, note.edges_m, note.lanes_m):
        if not (np.abs(some_m) < _FAR_M).all():
            raise InputError("a place of a site map is not finite, or too far away")
    for item in note.objects:
        sizes_m = (item.size_m, item.width_m, item.height_m or 0.0, item.height_std_m or 0.0)
        is_real = all(0.0 <= size < _FAR_M for size in sizes_m) and item.id >= 0
        if not (0 <= item.class_id < len(classes) and is_real):
            raise InputError(f"the object {item} of a site map is none")
    for mover in note.movers:
        sizes = (mover.speed_mps, mover.std_m, mover.std_mps, mover.radius_m)
        if not all(0.0 <= size < _FAR_M for size in sizes):
            raise InputError(f"the mover {mover} of a site map is none")
