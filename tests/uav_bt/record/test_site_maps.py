"""Site maps in records."""

from __future__ import annotations

import base64
import math
from dataclasses import replace

import numpy as np
import pytest

from tests.paper_lab import CLASSES
from uav_bt.errors import InputError
from uav_bt.files import parse_json
from uav_bt.record.channels import SiteMapNote
from uav_bt.record.site_maps import note_of, site_map_of
from uav_bt.record.values import decode, dump, encode
from uav_bt.types import Pose2D
from uav_bt.types.site_map import MapMark, MapMover, MapObject, SiteMap

RANDOM = np.random.default_rng(0)
SHAPE = (31, 42)
PLACE = {"x_m": 1.0, "y_m": -0.5, "x_mps": 0.2, "y_mps": -0.4, "std_m": 0.05, "std_mps": 0.1}
MOVER = MapMover(**PLACE, id=3, radius_m=0.25, first_s=9.0, seen_s=12.4)
BOX = MapObject(class_id=5, x_m=1.5, y_m=2.0, size_m=0.4, std_m=0.1, seen_s=12.0)


def site_map() -> SiteMap:
    def some() -> np.ndarray:
        return RANDOM.random(SHAPE) < 0.3

    return SiteMap(
        classes=CLASSES,
        pose=Pose2D(x_m=0.1, y_m=1 / 3, yaw_rad=-2.0),
        corner_m=(-1.5, 0.7),
        cell_m=0.1,
        seen_s=np.where(some(), 7.0, -np.inf),
        free=some(),
        outside=some(),
        passed=some(),
        obstacles_m=RANDOM.normal(size=(9, 2)),
        edges_m=RANDOM.normal(size=(5, 2)),
        captured_s=12.5,
        objects=(BOX, replace(BOX, class_id=4, id=3, points=7, height_m=0.8, height_std_m=0.02)),
        mark=MapMark(x_m=0.0, y_m=0.1, std_m=0.02, seen_s=3.0),
        movers=(MOVER,),
        contradicted_s=0.5,
        restarts=2,
        full=True,
        untracked_s=math.inf,  # the ground was never tracked
    )


def test_a_map_comes_back() -> None:
    kept = site_map()
    plain = parse_json(dump(encode(note_of(kept))))
    back = site_map_of(decode(SiteMapNote, plain), CLASSES)
    for grid in ("ground", "free", "outside", "passed"):
        assert np.array_equal(getattr(back, grid), getattr(kept, grid)), grid
    for points in ("obstacles_m", "edges_m"):
        assert getattr(back, points) == pytest.approx(getattr(kept, points), abs=6e-4), points
    names = ("pose", "corner_m", "cell_m", "captured_s", "objects", "mark", "movers", "correction")
    for name in (*names, "contradicted_s", "restarts", "full", "untracked_s"):
        assert getattr(back, name) == getattr(kept, name), name


def test_a_map_is_small() -> None:
    blank = np.zeros((120, 120), dtype=np.bool_)
    blank[20:90, 20:90] = True
    seen_s = np.where(blank, 1.0, -np.inf)
    large = replace(site_map(), seen_s=seen_s, free=blank, outside=~blank, passed=blank)
    assert len(dump(encode(note_of(large)))) < 4_000


@pytest.mark.parametrize("cells_png", ["no image", base64.b64encode(b"no PNG").decode()])
def test_cells_that_are_no_image_are_refused(cells_png: str) -> None:
    with pytest.raises((InputError, ValueError)):
        site_map_of(replace(note_of(site_map()), cells_png=cells_png), CLASSES)
