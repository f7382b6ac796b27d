"""A site map as a record's message and back: its grids as one image, the rest as numbers.

The image has one byte per cell and one bit per grid, but not when a cell showed ground.
"""

from __future__ import annotations

import base64
from dataclasses import fields
from typing import Final

import numpy as np

from uav_bt.lab.classes import LabClasses
from uav_bt.record.channels import SiteMapNote
from uav_bt.record.images import decode_bytes, encode_bytes
from uav_bt.types.site_map import SiteMap, SiteMapBase

_GROUND, _FREE, _OUTSIDE, _PASSED = 1, 2, 4, 8  # bits of a cell
_DECIMALS: Final = 3  # decimal places of points in metres


def note_of(site_map: SiteMap) -> SiteMapNote:
    """Return the message of a map for a record."""
    cells = np.zeros(site_map.free.shape, dtype=np.uint8)
    cells[site_map.ground] |= _GROUND
    cells[site_map.free] |= _FREE
    cells[site_map.outside] |= _OUTSIDE
    cells[site_map.passed] |= _PASSED
    kept = {item.name: getattr(site_map, item.name) for item in fields(SiteMapBase)}
    for name in ("obstacles_m", "edges_m", "lanes_m"):
        kept[name] = kept[name].round(_DECIMALS)
    cells_png = base64.b64encode(encode_bytes(cells)).decode("ascii")
    return SiteMapNote(cells_png=cells_png, **kept)


def site_map_of(note: SiteMapNote, classes: LabClasses) -> SiteMap:
    """Return the map of a note; InputError or ValueError if its grids are no image.

    All its ground gets the capture time of the newest frame.
    """
    cells = decode_bytes(base64.b64decode(note.cells_png, validate=True))
    return SiteMap(
        classes=classes,
        seen_s=np.where(cells & _GROUND, note.captured_s, -np.inf),
        free=(cells & _FREE) > 0,
        outside=(cells & _OUTSIDE) > 0,
        passed=(cells & _PASSED) > 0,
        **{item.name: getattr(note, item.name) for item in fields(SiteMapBase)},
    )
