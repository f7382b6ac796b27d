"""Complete perception of a frame, without a tree."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from perception.camera.ground_plane import ground_depth, view_of
from tests.paper_lab import BACKGROUND, BOXES, CARPET, HELIPAD_BOX, HELIPAD_H, paper_map
from uav_bt.app.perceive.pipeline import STAGES, Pipeline
from uav_bt.errors import AnswerError, ShapeError
from uav_bt.types import (
    BodyVelocity,
    CameraModel,
    ClassMap,
    DepthMap,
    DroneState,
    FlyingState,
    Frame,
)
from uav_bt.types.projection import project

SIZE = (224, 112)
CAMERA = CameraModel(width_px=64, height_px=36, fx_px=46.0, fy_px=46.0, cx_px=31.5, cy_px=17.5)
MAP_CAMERA = CAMERA.resized(*SIZE)
PITCH_RAD = math.radians(-30.0)
BOX = BOXES[0]


class Painted:
    """A segmenter that returns given ids."""

    def __init__(self, ids: NDArray[np.uint8]) -> None:
        self.ids = ids

    def segment(self, frame: Frame) -> ClassMap:
        return paper_map(ids=self.ids, captured_s=frame.captured_s)


class Halves:
    """A depth network, exact on the ground, whose unit is first 2 m."""

    unit_m = 2.0

    def estimate(self, frame: Frame) -> DepthMap:
        exact = ground_depth(view_of(frame, CAMERA, SIZE))
        depth = np.where(np.isfinite(exact), exact / self.unit_m, 4.0).astype(np.float32)
        return DepthMap(depth=depth, metric=False, captured_s=frame.captured_s)


def bare_ground() -> NDArray[np.uint8]:
    """Class ids: ground up to 4 m, background beyond."""
    exact = ground_depth(view_of(frame(), CAMERA, SIZE))
    return np.where(exact < 4.0, CARPET, BACKGROUND).astype(np.uint8)


def with_box() -> NDArray[np.uint8]:
    """Class ids of a box in the middle of the image, which meets the ground at row 80."""
    ids = bare_ground()
    ids[:80, 96:128] = BOX
    return ids


def frame(index: int = 0, **changes: float) -> Frame:
    """Return a different picture at each call."""
    values = {
        "captured_s": 0.1 * index,
        "gimbal_pitch_rad": PITCH_RAD,
        "height_above_ground_m": 1.5,
    } | changes
    image = np.random.default_rng(index).integers(40, 200, (36, 64, 3), dtype=np.uint8)
    return Frame(image=image, index=index, **values)


def state(time_s: float, forward_mps: float = 0.5) -> DroneState:
    return DroneState(
        captured_s=time_s,
        flying=FlyingState.FLYING,
        velocity=BodyVelocity(forward_mps=forward_mps),
    )


def pipeline(
    ids: NDArray[np.uint8],
    network: Halves | None = None,
    camera: CameraModel = CAMERA,
) -> Pipeline:
    rng = np.random.default_rng(0)
    return Pipeline(Painted(ids), network, camera, generator=rng)


def pad_at(forward_m: float, right_m: float) -> NDArray[np.uint8]:
    """Paint a mark's H and rim where a pad 0.4 m high would appear."""
    ids = bare_ground()
    ahead_m = forward_m - CAMERA.forward_offset_m
    column, row = project([ahead_m, right_m, 1.1], MAP_CAMERA, PITCH_RAD)
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    distance = np.hypot((columns - column) / 2.0, rows - row)
    ids[distance < 9] = HELIPAD_BOX
    ids[distance < 6] = HELIPAD_H
    return ids


def test_ground_has_the_depth_of_the_ground_and_the_corridor_is_clear() -> None:
    seen = pipeline(bare_ground()).perceive(frame())
    exact = ground_depth(view_of(frame(), CAMERA, SIZE))
    on_ground = seen.class_map.ids == CARPET
    assert seen.depth is not None
    assert seen.depth.depth[on_ground] == pytest.approx(exact[on_ground])
    assert seen.corridor is not None
    assert seen.corridor.nearest_side is None
    assert seen.corridor.free_distance_m == math.inf
    assert seen.intruding is not None
    assert not seen.intruding.any()
    assert (seen.refusal, seen.mark) == ("", None)


def test_a_frame_without_an_answer_of_the_network_has_no_depth() -> None:
    class Holed(Halves):
        def estimate(self, frame: Frame) -> DepthMap:
            raise AnswerError("net.onnx", f"frame {frame.index} holds NaN")

    seen = pipeline(bare_ground(), Holed()).perceive(frame())
    assert (seen.depth, seen.refusal) == (None, "net.onnx: frame 0 holds NaN")


def test_a_picture_that_stands_still_while_the_drone_flies_is_frozen() -> None:
    flying, first = pipeline(bare_ground(), Halves()), frame()
    again = replace(first, index=1, captured_s=0.1)
    assert flying.perceive(first, [state(0.0)]).refusal == ""
    frozen = flying.perceive(again, [state(0.1)])
    assert (frozen.refusal, frozen.depth) == ("the image is frozen", None)
    assert "relative_depth" not in frozen.stage_s


def test_a_restarted_pipeline_knows_no_image_mark_or_telemetry() -> None:
    segmenter, first = Painted(pad_at(2.0, 0.5)), frame()
    flying = Pipeline(segmenter, None, CAMERA, generator=np.random.default_rng(0))
    assert flying.perceive(first, [state(0.0)]).mark is not None
    flying.restart()
    segmenter.ids = with_box()
    seen = flying.perceive(replace(first, index=1, captured_s=0.1))
    assert (seen.refusal, seen.mark) == ("", None)
    assert seen.corridor is not None
    assert seen.corridor.time_to_impact_s == math.inf


@pytest.mark.parametrize("states", [[], [state(0.0, forward_mps=0.0)]], ids=["unknown", "hovers"])
def test_the_same_picture_is_no_fault_where_nothing_moves(states: list[DroneState]) -> None:
    standing, first = pipeline(bare_ground()), frame()
    standing.perceive(first, states)
    assert standing.perceive(replace(first, index=1, captured_s=0.1)).refusal == ""


def test_a_mark_is_placed_where_it_is() -> None:
    seen = pipeline(pad_at(2.0, 0.5)).perceive(frame())
    assert seen.mark is not None
    assert seen.mark.detected
    assert (seen.mark.forward_m, seen.mark.right_m) == pytest.approx((2.0, 0.5), abs=0.05)


def test_without_telemetry_a_mark_is_reported_only_while_it_is_seen() -> None:
    segmenter = Painted(pad_at(2.0, 0.5))
    blind = Pipeline(segmenter, None, CAMERA, generator=np.random.default_rng(0))
    assert blind.perceive(frame(0)).mark is not None
    segmenter.ids = bare_ground()
    assert blind.perceive(frame(1)).mark is None


def test_telemetry_carries_a_mark_until_it_is_lost() -> None:
    segmenter = Painted(pad_at(2.0, 0.5))
    flying = Pipeline(segmenter, None, CAMERA, generator=np.random.default_rng(0))
    flying.perceive(frame(0), [state(0.0)])
    segmenter.ids = bare_ground()
    carried = flying.perceive(frame(10), [state(1.0)]).mark
    assert carried is not None
    assert not carried.detected
    assert carried.forward_m == pytest.approx(1.5, abs=0.05)
    assert flying.perceive(frame(130), [state(13.0, 0.0)]).mark is None


def test_every_stage_is_timed() -> None:
    ticks = iter(range(100))
    timed = Pipeline(
        Painted(bare_ground()),
        Halves(),
        CAMERA,
        generator=np.random.default_rng(0),
        timer=lambda: float(next(ticks)),
    )
    # The clock is read twice more while the metric depth is made, for the network.
    assert timed.perceive(frame()).stage_s == dict.fromkeys(STAGES, 1.0) | {"metric_depth": 2.0}


def test_frames_of_a_distorting_lens_are_straightened() -> None:
    bent = replace(CAMERA, distortion=(-0.3, 0.1, 0.0, 0.0, 0.0))
    straight = pipeline(bare_ground(), camera=bent)
    assert straight.camera.distortion == ()
    assert not np.array_equal(straight.perceive(frame()).frame.image, frame().image)


def test_a_frame_of_another_size_is_refused() -> None:
    with pytest.raises(ShapeError, match="36x64, as its camera"):
        pipeline(bare_ground()).perceive(replace(frame(), image=np.zeros((36, 65, 3), np.uint8)))
