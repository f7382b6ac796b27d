"""Clips: which frames go together, and that every variation of one is still true."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from perception.depth.training.clips import Clip, ClipSource, mirrored, turned, varied
from perception.depth.training.footage import Flight
from perception.depth.training.losses import photometric_error, warp
from tests.perception.depth.depth_flight import known_flight
from uav_bt.errors import ValueRangeError


@pytest.fixture(scope="module")
def flight() -> Flight:
    known = known_flight()
    return replace(known.footage, labels=known.labels())


@pytest.fixture(scope="module")
def clip(flight: Flight) -> Clip:
    return ClipSource([flight]).neighbours(np.random.default_rng(0))


def _warping_error(clip: Clip) -> float:
    """How unlike the target is to the first reference, warped with the target's labels."""
    assert clip.labels is not None
    pictures = torch.from_numpy(clip.images).permute(0, 3, 1, 2)
    pictures = torch.nn.functional.avg_pool2d(pictures, 2)
    intrinsics = torch.tensor([clip.camera.resized(160, 128).pinhole_px])
    depth = torch.from_numpy(clip.labels[:1, ..., 0])[None]
    known = torch.isfinite(depth) & (depth < 5.0)
    motion = torch.from_numpy(clip.motions[:1])
    values, _, valid = warp(pictures[1:2], depth.where(known, 1.0), motion, intrinsics)
    error = photometric_error(pictures[:1], values)
    counts = (known & valid).float()
    assert counts.mean() > 0.3
    return float((error * counts).sum() / counts.sum())


def test_references_are_near_enough_and_far_enough(flight: Flight) -> None:
    source = ClipSource([flight])
    for seed in range(8):
        clip = source.neighbours(np.random.default_rng(seed))
        moved_m = np.linalg.norm(clip.motions[:, :, 3], axis=1)
        assert (moved_m > 0.03).all()  # measured on the ground, chosen by telemetry
        assert (moved_m < 0.53).all()


def test_labels_movements_and_pictures_belong_together(clip: Clip) -> None:
    assert _warping_error(clip) < 0.08


def test_a_mirrored_clip_is_as_consistent(clip: Clip) -> None:
    flipped = mirrored(clip)
    assert _warping_error(flipped) == pytest.approx(_warping_error(clip), abs=0.01)
    np.testing.assert_array_equal(flipped.images[:, :, ::-1], clip.images)
    twice = mirrored(flipped)
    np.testing.assert_allclose(twice.motions, clip.motions, atol=1e-7)
    assert twice.camera.cx_px == pytest.approx(clip.camera.cx_px)


@pytest.mark.parametrize(("pitch_rad", "roll_rad"), [(0.08, 0.0), (-0.08, 0.0), (0.03, 0.05)])
def test_a_turned_clip_is_as_consistent(clip: Clip, pitch_rad: float, roll_rad: float) -> None:
    other = turned(clip, pitch_rad, roll_rad)
    assert _warping_error(other) == pytest.approx(_warping_error(clip), abs=0.02)
    assert abs(other.images - clip.images).mean() > 0.02


def test_looking_further_up_lowers_what_was_seen(clip: Clip) -> None:
    labels = np.full((3, 128, 160, 2), np.nan, np.float32)
    labels[:, 60:64] = 2.0
    other = turned(replace(clip, labels=labels), 0.1, 0.0)
    assert other.labels is not None
    rows = np.flatnonzero(np.isfinite(other.labels[0, :, 80, 0]))
    assert rows.mean() == pytest.approx(62 + 0.1 * clip.camera.fy_px / 2, abs=2.0)


def test_the_same_generator_varies_a_clip_equally(clip: Clip) -> None:
    one, two, other = (varied(clip, np.random.default_rng(seed)) for seed in (5, 5, 6))
    np.testing.assert_array_equal(one.images, two.images)
    np.testing.assert_array_equal(one.motions, two.motions)
    assert (one.images != other.images).any()


def test_other_light_is_the_same_for_all_frames_of_a_clip(clip: Clip) -> None:
    grey = replace(clip, images=np.full_like(clip.images, 0.5))
    lit = varied(grey, np.random.default_rng(3)).images
    assert np.ptp(lit, axis=(0, 1, 2)).max() < 1e-4
    assert np.abs(lit - 0.5).max() > 0.01


def test_single_frames_need_no_movement(flight: Flight) -> None:
    source = ClipSource([replace(flight, frames=flight.frames[:1] * 12)])
    assert source.frame_count == 4  # every third of twelve
    assert source.singles(np.random.default_rng(0)).images.shape == (3, 256, 320, 3)
    with pytest.raises(ValueRangeError, match="fly further"):
        source.neighbours(np.random.default_rng(0))


def test_a_flight_that_stays_on_the_ground_is_refused(flight: Flight) -> None:
    low = [replace(frame, height_above_ground_m=0.7) for frame in flight.frames]
    with pytest.raises(ValueRangeError, match="fly higher"):
        ClipSource([replace(flight, frames=tuple(low))])
