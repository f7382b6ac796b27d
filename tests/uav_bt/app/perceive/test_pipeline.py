"""Complete perception of a frame, without a tree, and the telemetry of a video's frames."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from perception.camera.ground_plane import ground_depth, view_of
from tests.paper_lab import BACKGROUND, BOXES, CARPET, HELIPAD_BOX, HELIPAD_H, paper_map
from tests.worlds import footage, values
from tests.worlds.footage import state, write_record
from uav_bt.app.perceive.inputs import Telemetry
from uav_bt.app.perceive.pipeline import STAGES, Pipeline
from uav_bt.errors import AnswerError, FileError, ShapeError
from uav_bt.record.reader import RecordReader
from uav_bt.types import CameraModel, ClassMap, DepthMap, DroneState, Frame
from uav_bt.types.projection import project

SIZE = (224, 112)
CAMERA = CameraModel(width_px=64, height_px=36, fx_px=46.0, fy_px=46.0, cx_px=31.5, cy_px=17.5)
MAP_CAMERA = CAMERA.resized(*SIZE)
PITCH_RAD = math.radians(-30.0)


class Painted:
    """A segmenter that returns given ids."""

    def __init__(self, ids: NDArray[np.uint8]) -> None:
        self.ids = ids

    def segment(self, frame: Frame) -> ClassMap:
        return paper_map(ids=self.ids, captured_s=frame.captured_s)


class Halves:
    """A depth network, exact on the ground, whose unit is 2 m."""

    def estimate(self, frame: Frame) -> DepthMap:
        exact = ground_depth(view_of(frame, CAMERA, SIZE))
        depth = np.where(np.isfinite(exact), exact / 2.0, 4.0).astype(np.float32)
        return DepthMap(depth=depth, metric=False, captured_s=frame.captured_s)


def frame(index: int = 0) -> Frame:
    """Return a different picture for each index, ten of them a second."""
    image = np.random.default_rng(index).integers(40, 200, (36, 64, 3), dtype=np.uint8)
    return values.frame(image, PITCH_RAD, captured_s=0.1 * index, index=index)


def bare_ground() -> NDArray[np.uint8]:
    """Class ids: ground up to 4 m, background beyond."""
    exact = ground_depth(view_of(frame(), CAMERA, SIZE))
    return np.where(exact < 4.0, CARPET, BACKGROUND).astype(np.uint8)


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


def pipeline(
    ids: NDArray[np.uint8],
    network: Halves | None = None,
    camera: CameraModel = CAMERA,
    **more: Any,
) -> tuple[Pipeline, Painted]:
    """Return a pipeline and its segmenter."""
    painted = Painted(ids)
    made = Pipeline(painted, network, camera, **more)
    return made, painted


def test_ground_has_the_depth_of_the_ground_and_the_corridor_is_clear() -> None:
    seen = pipeline(bare_ground())[0].perceive(frame())
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

    seen = pipeline(bare_ground(), Holed())[0].perceive(frame())
    assert (seen.depth, seen.refusal) == (None, "net.onnx: frame 0 holds NaN")


@pytest.mark.parametrize(
    ("states", "refusal"),
    [([state(0.0)], "the image is frozen"), ([], ""), ([state(0.0, forward_mps=0.0)], "")],
)
def test_a_still_picture_of_a_flight_is_frozen(states: list[DroneState], refusal: str) -> None:
    """Where nothing moves, the same picture is no fault."""
    (flying, _), first = pipeline(bare_ground(), Halves()), frame()
    assert flying.perceive(first, states).refusal == ""
    later = [replace(one, captured_s=0.1) for one in states]
    again = flying.perceive(replace(first, index=1, captured_s=0.1), later)
    assert (again.refusal, again.depth is None) == (refusal, refusal != "")
    assert ("relative_depth" in again.stage_s) == (refusal == "")


def test_a_restarted_pipeline_knows_no_image_mark_or_telemetry() -> None:
    (flying, segmenter), first = pipeline(pad_at(2.0, 0.5)), frame()
    assert flying.perceive(first, [state(0.0)]).mark is not None
    flying.restart()
    segmenter.ids = bare_ground()
    segmenter.ids[:80, 96:128] = BOXES[0]  # it meets the ground at row 80
    seen = flying.perceive(replace(first, index=1, captured_s=0.1))
    assert (seen.refusal, seen.mark) == ("", None)
    assert seen.corridor is not None
    assert seen.corridor.time_to_impact_s == math.inf


def test_a_mark_is_placed_and_without_telemetry_reported_only_while_it_is_seen() -> None:
    blind, segmenter = pipeline(pad_at(2.0, 0.5))
    mark = blind.perceive(frame(0)).mark
    assert mark is not None
    assert mark.detected
    assert (mark.forward_m, mark.right_m) == pytest.approx((2.0, 0.5), abs=0.05)
    segmenter.ids = bare_ground()
    assert blind.perceive(frame(1)).mark is None


def test_telemetry_carries_a_mark_until_it_is_lost() -> None:
    flying, segmenter = pipeline(pad_at(2.0, 0.5))
    flying.perceive(frame(0), [state(0.0)])
    segmenter.ids = bare_ground()
    carried = flying.perceive(frame(10), [state(1.0)]).mark
    assert carried is not None
    assert not carried.detected
    assert carried.forward_m == pytest.approx(1.5, abs=0.05)
    assert flying.perceive(frame(130), [state(13.0, 0.0)]).mark is None


def test_every_stage_is_timed() -> None:
    ticks = iter(range(100))
    timed, _ = pipeline(bare_ground(), Halves(), timer=lambda: float(next(ticks)))
    # The clock is read twice more while the metric depth is made, for the network.
    assert timed.perceive(frame()).stage_s == dict.fromkeys(STAGES, 1.0) | {"metric_depth": 2.0}


def test_frames_of_a_distorting_lens_are_straightened_and_those_of_another_size_refused() -> None:
    bent = replace(CAMERA, distortion=(-0.3, 0.1, 0.0, 0.0, 0.0))
    straight, _ = pipeline(bare_ground(), camera=bent)
    assert straight.camera.distortion == ()
    assert not np.array_equal(straight.perceive(frame()).frame.image, frame().image)
    with pytest.raises(ShapeError, match="36x64, as its camera"):
        straight.perceive(replace(frame(), image=np.zeros((36, 65, 3), np.uint8)))


# --- telemetry ------------------------------------------------------------------------------------

IMAGE = np.zeros((36, 64, 3), np.uint8)


@pytest.fixture
def flown(tmp_path: Path) -> Telemetry:
    """Three frames from 10 s on, during a climb and a turn across yaw = pi."""
    frames = [
        footage.frame(
            IMAGE,
            place,
            10.0 + place,
            gimbal_pitch_rad=-0.5 - 0.1 * place,
            height_above_ground_m=1.4 + place,
            yaw_rad=yaw_rad,
        )
        for place, yaw_rad in enumerate((3.0, -3.2, -3.1))
    ]
    states = [state(*one) for one in ((9.8, 0.1), (10.1, 0.2), (10.9, 0.3), (11.5, 0.4))]
    path = write_record(tmp_path / "flight.mcap", CAMERA, frames, states)
    return Telemetry.of_flight(RecordReader(path))


def test_a_fixed_camera_has_the_same_pose_in_every_frame_and_no_states() -> None:
    fixed = Telemetry.fixed(1.2, -0.6)
    frame = fixed.frame(IMAGE, 7, 3.5)
    assert (frame.index, frame.captured_s) == (7, 3.5)
    assert (frame.height_above_ground_m, frame.gimbal_pitch_rad) == (1.2, -0.6)
    assert fixed.states(10.0) == []


def test_a_flights_telemetry_begins_with_its_video_and_is_interpolated(flown: Telemetry) -> None:
    assert flown.times_s == pytest.approx([0.0, 1.0, 2.0])
    heights_m = [
        flown.frame(IMAGE, 0, time_s).height_above_ground_m for time_s in (-0.5, 0.0, 0.5, 2.5)
    ]
    assert heights_m == pytest.approx([math.nan, 1.4, 1.9, math.nan], nan_ok=True)
    between = flown.frame(IMAGE, 0, 0.5)
    assert between.gimbal_pitch_rad == pytest.approx(-0.55)
    # From 3.0 to -3.2 the short way across pi is 0.08 rad, the long way 6.2 rad.
    assert math.cos(between.attitude.yaw_rad) < -0.99


def test_states_come_once_and_up_to_the_time_asked_for(flown: Telemetry) -> None:
    assert [state.captured_s for state in flown.states(0.1)] == pytest.approx([-0.2, 0.1])
    assert flown.states(0.1) == []
    assert [state.velocity.forward_mps for state in flown.states(5.0)] == [0.3, 0.4]


def test_a_record_without_a_frame_is_refused(tmp_path: Path) -> None:
    path = write_record(tmp_path / "flight.mcap", CAMERA, [], [state(0.0)])
    with pytest.raises(FileError, match="no frame with an image"):
        Telemetry.of_flight(RecordReader(path))
