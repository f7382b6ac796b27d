"""The site map in a Rerun view."""

from __future__ import annotations

import cv2
import numpy as np

from tests.uav_bt.display.display_world import LAB, World
from tests.uav_bt.display.rerun.rerun_world import NotedStream
from tests.uav_bt.display.test_live_map import believed
from uav_bt.display.flown_path import FlownPath
from uav_bt.display.rerun.site_map import SiteMapView


def test_the_map_is_an_image_twice_a_second() -> None:
    stream, world, flown = NotedStream(), World(), FlownPath()
    view = SiteMapView(stream, LAB)
    for index in range(12):
        record = world.tick()
        flown.add(record)
        view.show(record, flown, believed() if index else None)
    images = stream.of("site_map")
    assert len(images) == 3, "from the second tick on, every fifth"
    blob = np.asarray(images[-1].thing.blob.as_arrow_array().to_pylist()[0], dtype=np.uint8)
    image = cv2.imdecode(blob, cv2.IMREAD_COLOR)
    assert image is not None
    assert image.shape == (520, 640, 3)
    assert image.std() > 5.0, "it shows something"


def test_without_a_map_nothing_is_drawn() -> None:
    stream, world, flown = NotedStream(), World(), FlownPath()
    record = world.tick()
    flown.add(record)
    SiteMapView(stream, None).show(record, flown, None)
    assert stream.notes == []
