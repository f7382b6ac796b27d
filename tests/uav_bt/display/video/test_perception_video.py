"""The images of `uav-bt net perceive`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.paper_lab import CLASSES, paper_map
from tests.uav_bt.display.display_world import CAMERA
from tests.worlds import values
from uav_bt.display.canvas import ACCENT, PANEL
from uav_bt.display.video.perception_video import PerceptionPanes, Seen
from uav_bt.types import DepthMap, MarkFix

IDS = np.full((28, 56), 5, np.uint8)


def seen(**changes: object) -> Seen:
    frame = values.frame(np.full((36, 64, 3), 90, np.uint8), captured_s=1.5)
    nothing = Seen(
        frame=frame,
        class_map=paper_map(ids=IDS, captured_s=1.5),
        depth=None,
        refusal="the frame is black",
        corridor=None,
        intruding=None,
        mark=None,
    )
    return replace(nothing, **changes)


def test_four_panes_make_a_picture_of_1280x720() -> None:
    panes = PerceptionPanes(CAMERA)
    image = panes.draw(seen())
    assert panes.size_px == (1280, 720)
    assert image.shape == (720, 1280, 3)
    assert tuple(image[100, 300]) == (90, 90, 90), "the image"
    assert tuple(image[600, 300]) == tuple(CLASSES.colours[5]), "the class map"
    assert tuple(image[30, 1000]) == PANEL, "no depth"
    assert tuple(image[700, 1000]) == PANEL, "no corridor"
    depth = DepthMap(depth=np.full((28, 56), 1.0, np.float32), metric=True, captured_s=1.5)
    assert tuple(panes.draw(seen(depth=depth, refusal=""))[100, 900]) != PANEL


def test_a_mark_is_ringed() -> None:
    panes = PerceptionPanes(CAMERA)
    fix = MarkFix(captured_s=1.5, forward_m=2.0, right_m=0.0, height_m=0.4, detected=True)

    def accents(one: Seen) -> int:
        upper_left = panes.draw(one)[:360, :640]
        return int(np.count_nonzero((upper_left == np.array(ACCENT)).all(axis=2)))

    assert accents(seen()) == 0
    assert accents(seen(mark=fix)) > 100


def test_images_are_shown_in_the_aspect_of_the_lens() -> None:
    assert PerceptionPanes(CAMERA.resized(40, 32)).size_px == (1280, 720), "a resized image"
    square = replace(CAMERA, width_px=64, height_px=64)
    assert PerceptionPanes(square).size_px == (1280, 1280)
