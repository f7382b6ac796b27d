"""Clips: which frames go together, and that every variation of one is still true."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from perception.depth.training import clips
from perception.depth.training.clip import Clip
from perception.depth.training.clip import mirrored as mirrored_clip
from perception.depth.training.clip import turned as turned_clip
from perception.depth.training.losses import photometric_error, warp
from tests.perception.depth.depth_flight import KnownFlight, known_flight
from uav_bt.errors import ShapeError, ValueRangeError

PLAIN = clips.ClipConfig(pitch_rad=0.0, roll_rad=0.0, flip=0.0, brightness=0.0, tint=0.0)


@pytest.fixture(scope="module")
def known() -> KnownFlight:
    return known_flight()


@pytest.fixture(scope="module")
def flight(known: KnownFlight) -> clips.Flight:
    return clips.Flight(footage=known.footage, labels=known.labels())


def _draw(flight: clips.Flight, config: clips.ClipConfig = PLAIN, seed: int = 0) -> Clip:
    return clips.ClipSource([flight], config).draw(np.random.default_rng(seed))


def _warping_error(clip: Clip) -> float:
    """How unlike the target is to the first reference, warped with the target's labels."""
    assert clip.labels is not None
    pictures = torch.nn.functional.avg_pool2d(torch.from_numpy(clip.images), 2)
    fx, fy, cx, cy = clip.intrinsics
    intrinsics = torch.tensor([[fx / 2, fy / 2, (cx - 0.5) / 2, (cy - 0.5) / 2]])
    depth = torch.from_numpy(clip.labels[:1])[None]
    known = torch.isfinite(depth) & (depth < 5.0)
    motion = torch.from_numpy(clip.motions[:1])
    warped = warp(pictures[1:2], depth.where(known, 1.0), motion, intrinsics)
    error = photometric_error(pictures[:1], warped.values)
    counts = (known & warped.valid).float()
    assert counts.mean() > 0.3
    return float((error * counts).sum() / counts.sum())


def test_references_are_near_enough_and_far_enough(flight: clips.Flight) -> None:
    config = replace(PLAIN, min_move_m=0.12, max_move_m=0.3)
    source = clips.ClipSource([flight], config)
    for seed in range(8):
        clip = source.draw(np.random.default_rng(seed))
        moved_m = np.linalg.norm(clip.motions[:, :, 3], axis=1)
        assert (moved_m > 0.09).all()  # measured on the ground, chosen by telemetry
        assert (moved_m < 0.33).all()


def test_labels_movements_and_pictures_belong_together(flight: clips.Flight) -> None:
    assert _warping_error(_draw(flight)) < 0.08


def test_a_mirrored_clip_is_as_consistent(flight: clips.Flight) -> None:
    clip = _draw(flight)
    mirrored = mirrored_clip(clip)
    assert _warping_error(mirrored) == pytest.approx(_warping_error(clip), abs=0.01)
    np.testing.assert_array_equal(mirrored.images[..., ::-1], clip.images)
    twice = mirrored_clip(mirrored)
    np.testing.assert_allclose(twice.motions, clip.motions, atol=1e-7)
    np.testing.assert_allclose(twice.intrinsics, clip.intrinsics)


@pytest.mark.parametrize(("pitch_rad", "roll_rad"), [(0.08, 0.0), (-0.08, 0.0), (0.03, 0.05)])
def test_a_turned_clip_is_as_consistent(
    flight: clips.Flight, pitch_rad: float, roll_rad: float
) -> None:
    clip = _draw(flight)
    turned = turned_clip(clip, pitch_rad, roll_rad)
    assert _warping_error(turned) == pytest.approx(_warping_error(clip), abs=0.02)
    assert abs(turned.images - clip.images).mean() > 0.02


def test_turning_by_nothing_changes_nothing(flight: clips.Flight) -> None:
    clip = _draw(flight)
    turned = turned_clip(clip, 0.0)
    np.testing.assert_allclose(turned.images, clip.images, atol=2e-3)
    np.testing.assert_allclose(turned.motions, clip.motions, atol=1e-6)
    assert turned.labels is not None
    assert clip.labels is not None
    np.testing.assert_allclose(turned.labels, clip.labels, rtol=1e-5)


def test_looking_further_up_lowers_what_was_seen(flight: clips.Flight) -> None:
    clip = _draw(flight)
    labels = np.full((3, 128, 160), np.nan, np.float32)
    labels[:, 60:64] = 2.0
    turned = turned_clip(replace(clip, labels=labels), 0.1)
    assert turned.labels is not None
    rows = np.flatnonzero(np.isfinite(turned.labels[0, :, 80]))
    expected = 62 + 0.1 * clip.intrinsics[1] / 2
    assert rows.mean() == pytest.approx(expected, abs=2.0)


def test_the_same_generator_draws_the_same_clip(flight: clips.Flight) -> None:
    one, two = (_draw(flight, clips.ClipConfig(), seed=5) for _ in range(2))
    np.testing.assert_array_equal(one.images, two.images)
    np.testing.assert_array_equal(one.motions, two.motions)


def test_brightness_is_the_same_for_all_frames_of_a_clip(flight: clips.Flight) -> None:
    config = replace(PLAIN, brightness=0.2)
    bright, plain = _draw(flight, config, seed=3), _draw(flight, PLAIN, seed=3)
    dim = plain.images < 0.7  # the rest may be cut off
    ratio = bright.images[dim & (plain.images > 0.1)] / plain.images[dim & (plain.images > 0.1)]
    assert ratio.std() < 1e-3
    assert abs(ratio.mean() - 1.0) > 0.01


def test_single_frames_need_no_movement(flight: clips.Flight) -> None:
    source = clips.ClipSource([flight], PLAIN)
    clip = source.draw_frames(np.random.default_rng(0))
    assert clip.images.shape == (3, 3, 256, 320)
    assert source.frame_count == 4  # every third of twelve
    assert source.labelled


def test_a_flight_that_does_not_move_is_refused(flight: clips.Flight) -> None:
    config = replace(PLAIN, min_move_m=5.0, max_move_m=6.0)
    source = clips.ClipSource([flight], config)
    assert len(source) == 0
    assert source.draw_frames(np.random.default_rng(0)).labels is not None
    with pytest.raises(ValueRangeError, match="fly further"):
        source.draw(np.random.default_rng(0))


def test_a_flight_that_stays_on_the_ground_is_refused(flight: clips.Flight) -> None:
    with pytest.raises(ValueRangeError, match="fly higher"):
        clips.ClipSource([flight], replace(PLAIN, min_height_m=4.0))


def test_flights_with_and_without_labels_do_not_mix(flight: clips.Flight) -> None:
    bare = clips.Flight(footage=flight.footage)
    with pytest.raises(ValueRangeError, match="label all"):
        clips.ClipSource([flight, bare])


def test_flights_of_two_sizes_do_not_mix(flight: clips.Flight) -> None:
    footage = flight.footage
    small = replace(
        footage, frames=footage.frames[:, ::2, ::2], camera=footage.camera.resized(160, 128)
    )
    with pytest.raises(ValueRangeError, match="frames of one size"):
        clips.ClipSource([clips.Flight(footage=footage), clips.Flight(footage=small)])


def test_labels_of_another_flight_are_refused(flight: clips.Flight) -> None:
    labels = clips.DepthLabels(depth_m=np.zeros((3, 4, 5), np.float16))
    with pytest.raises(ShapeError, match="one a frame"):
        clips.Flight(footage=flight.footage, labels=labels)


def test_labels_must_match_their_bounds() -> None:
    with pytest.raises(ShapeError, match="depth bounds must be 2x3x4"):
        clips.DepthLabels(
            depth_m=np.zeros((2, 3, 4), np.float16), at_most_m=np.zeros((2, 3, 5), np.float16)
        )
