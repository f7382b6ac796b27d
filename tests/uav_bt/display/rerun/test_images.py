"""Images and overlays: outlines, redrawing and clearing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.paper_lab import paper_map
from tests.uav_bt.display.display_world import CAMERA, World
from tests.uav_bt.display.rerun.rerun_world import CLASSES, NotedStream, setting, values
from tests.worlds.values import corridor
from uav_bt.display.rerun.images import ImageView, outlines
from uav_bt.display.video.panes import pad_circle
from uav_bt.types import ClassMap, DepthMap, Frame, MarkFix

CLEAR = "Clear"

FREE = corridor(1.5, "left", nearest_m=0.6)


def frame(**changes: object) -> Frame:
    seen = World().tick().observation.frame
    assert seen is not None
    return replace(seen, **changes)  # type: ignore[arg-type]


def class_map(captured_s: float = 0.0) -> ClassMap:
    ids = np.zeros((18, 32), dtype=np.uint8)
    ids[9:] = 1
    ids[4:12, 10:20] = 2
    return paper_map(ids=ids, captured_s=captured_s)


def depth(captured_s: float = 0.0) -> DepthMap:
    metres = np.full((18, 32), 1.5, np.float32)
    metres[0] = np.nan
    return DepthMap(depth=metres, metric=True, captured_s=captured_s)


def kinds(stream: NotedStream, entity: str) -> list[str]:
    return [type(note.thing).__name__ for note in stream.of(entity)]


def test_outlines_are_closed_and_in_the_images_pixels() -> None:
    mask = np.zeros((10, 20), dtype=np.uint8)
    mask[2:5, 4:8] = 1
    (strip,) = outlines(mask, (40, 20))
    np.testing.assert_array_equal(strip[0], strip[-1])
    # Pixel centres 4 and 7 of 20 correspond to 8.5 and 14.5 of 40.
    assert (strip[:, 0].min(), strip[:, 0].max()) == (8.5, 14.5)
    assert (strip[:, 1].min(), strip[:, 1].max()) == (4.5, 8.5)


def test_single_pixels_have_no_outline() -> None:
    mask = np.zeros((10, 20), dtype=np.uint8)
    mask[5, 5] = 1
    assert outlines(mask, (40, 20)) == []


def test_classes_have_our_names_and_colours() -> None:
    stream = NotedStream()
    ImageView(stream, setting())
    (context,) = stream.of("mask")
    assert context.static
    shown = [entry["class_description"]["info"] for entry in values(context.thing.context)[0]]
    assert [info["label"] for info in shown] == list(CLASSES.names)
    assert [info["color"] >> 8 for info in shown] == [
        int(red) << 16 | int(green) << 8 | int(blue) for red, green, blue in CLASSES.colours
    ]


def test_an_image_is_drawn_once() -> None:
    stream = NotedStream()
    view = ImageView(stream, setting())
    first = frame()
    for shown in (None, first, first, replace(first, index=first.index + 1)):
        view.show_frame(shown, None)
    assert len(stream.of("world/camera/image")) == 2


def test_a_mask_is_drawn_with_its_edges_and_taken_away_when_it_is_old() -> None:
    stream = NotedStream()
    view = ImageView(stream, setting())
    for shown in (None, class_map(), class_map(), None):
        view.show_mask(shown)
    assert kinds(stream, "mask/ids") == ["SegmentationImage", CLEAR]
    assert kinds(stream, "world/camera/mask_edges") == ["LineStrips2D", CLEAR]
    edges = stream.of("world/camera/mask_edges")[0].thing
    assert len(values(edges.strips)) == 2  # ground and box; the background has none


def test_an_id_without_a_colour_stands_out_and_is_no_error() -> None:
    stream = NotedStream()
    view = ImageView(stream, setting())
    ids = class_map().ids.copy()
    ids[4:12, 10:20] = 99
    view.show_mask(paper_map(ids=ids, captured_s=0.0))
    edges = stream.last("world/camera/mask_edges")
    assert len(set(values(edges.colors))) == 2


def test_the_ring_lies_where_the_mark_is_seen() -> None:
    seen = frame(gimbal_pitch_rad=0.0, height_above_ground_m=0.4)  # level with the pad
    ahead = MarkFix(captured_s=0.0, forward_m=2.0, right_m=0.0, height_m=0.4, detected=True)
    ring = pad_circle(ahead, seen, CAMERA)
    assert ring is not None
    assert ring[:2] == pytest.approx((CAMERA.cx_px, CAMERA.cy_px), abs=1e-3)


@pytest.mark.parametrize("forward_m", [-2.0, 0.1])
def test_a_mark_behind_or_below_the_lens_has_no_ring(forward_m: float) -> None:
    fix = MarkFix(captured_s=0.0, forward_m=forward_m, right_m=0.0, height_m=0.4, detected=True)
    assert pad_circle(fix, frame(gimbal_pitch_rad=0.0), CAMERA) is None


def test_depth_is_in_metres_with_gaps_where_it_is_unknown() -> None:
    stream = NotedStream()
    view = ImageView(stream, setting())
    view.show_depth(depth(), None, frame(), class_map())
    image = stream.last("world/depth/metres")
    assert values(image.meter) == [1.0]
    metres = np.frombuffer(bytes(values(image.buffer)[0]), np.float16).reshape(18, 32)
    assert np.isnan(metres[0]).all()
    assert (metres[1:] == 1.5).all()
    view.show_depth(None, None, None, None)
    assert type(stream.last("world/depth/metres")).__name__ == CLEAR


def marked(*_: object) -> np.ndarray:
    inside = np.zeros((18, 32), dtype=bool)
    inside[5:9, 3:9] = True
    return inside


def test_intrusions_are_marked_with_their_side() -> None:
    stream = NotedStream()
    view = ImageView(stream, setting(intruding=marked))
    view.show_depth(depth(), FREE, frame(captured_s=0.0), class_map())
    marks = stream.last("world/camera/intrusions")
    assert values(marks.labels) == ["intrusion left, 0.60 m"]


def test_intrusions_of_another_frame_are_not_marked() -> None:
    stream = NotedStream()
    view = ImageView(stream, setting(intruding=marked))
    view.show_depth(depth(), FREE, frame(captured_s=0.1), class_map())
    assert stream.of("world/camera/intrusions") == []
