"""Material of the depth training: footage, clips, labels."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
import torch

from perception.depth.training import labelling
from perception.depth.training.clips import Clip, ClipSource, mirrored, turned, varied
from perception.depth.training.footage import CameraTrack, Flight, grey, shrink
from perception.depth.training.labelling import parallax_depth
from perception.depth.training.losses import photometric_error, warp
from tests.paper_lab import paper_map
from tests.perception.depth.depth_flight import KnownFlight, known_flight
from uav_bt.errors import ValueRangeError
from uav_bt.types import ClassMap, Frame


def test_an_image_is_resized_and_never_cropped() -> None:
    picture = np.zeros((360, 640, 3), np.uint8)
    picture[:, 320:] = 200
    small = shrink(picture)
    assert small.shape == (256, 320, 3)
    assert (small[:, :160] == 0).all()
    assert (small[:, 160:] == 200).all()


@pytest.fixture(scope="module")
def flight() -> KnownFlight:
    return known_flight()


@pytest.fixture(scope="module")
def noisy() -> KnownFlight:
    """The same flight; its compass is off by more than half a degree."""
    return known_flight(yaw_noise_rad=0.012, seed=3)


def _turn_error_rad(found: np.ndarray, true: np.ndarray) -> float:
    trace = np.trace(found[:, :3] @ true[:, :3].T)
    return float(np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0)))


def test_exact_telemetry_gives_the_exact_movement(flight: KnownFlight) -> None:
    track = CameraTrack(flight.footage)
    for origin, target in ((2, 6), (6, 2), (3, 9)):
        found, true = track.motion(origin, target), flight.motion(origin, target)
        assert _turn_error_rad(found, true) < 1e-4
        np.testing.assert_allclose(found[:, 3], true[:, 3], atol=2e-3)


def test_smoothing_keeps_the_turn_and_loses_noise(noisy: KnownFlight, flight: KnownFlight) -> None:
    raw, exact = (
        np.array([frame.attitude.yaw_rad for frame in each.footage.frames])
        for each in (noisy, flight)
    )
    smooth = CameraTrack(noisy.footage).yaw_rad
    assert np.std(smooth - exact) < 0.75 * np.std(raw - exact)


def test_the_ground_tells_the_movement_better_than_noisy_telemetry(noisy: KnownFlight) -> None:
    track = CameraTrack(noisy.footage)
    told, measured = [], []
    for origin, target in ((1, 4), (2, 6), (3, 7), (8, 4), (9, 5)):
        true = noisy.motion(origin, target)
        found = track.measured_motion(origin, target)
        assert found is not None
        told.append(_turn_error_rad(track.motion(origin, target), true))
        measured.append(_turn_error_rad(found, true))
        np.testing.assert_allclose(found[:, 3], true[:, 3], atol=0.02)
    assert np.mean(measured) < 0.003
    assert np.mean(measured) < 0.5 * np.mean(told)


def test_without_texture_nothing_is_measured(flight: KnownFlight) -> None:
    plain = np.full((256, 320, 3), 90, np.uint8)
    frames = tuple(replace(frame, image=plain) for frame in flight.footage.frames)
    assert CameraTrack(replace(flight.footage, frames=frames)).measured_motion(2, 6) is None


# --- clips ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def labelled(flight: KnownFlight) -> Flight:
    return replace(flight.footage, labels=flight.labels())


@pytest.fixture(scope="module")
def clip(labelled: Flight) -> Clip:
    return ClipSource([labelled]).neighbours(np.random.default_rng(0))


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


def test_references_are_near_enough_and_far_enough(labelled: Flight) -> None:
    source = ClipSource([labelled])
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


def test_single_frames_need_no_movement(labelled: Flight) -> None:
    source = ClipSource([replace(labelled, frames=labelled.frames[:1] * 12)])
    assert source.frame_count == 4  # every third of twelve
    assert source.singles(np.random.default_rng(0)).images.shape == (3, 256, 320, 3)
    with pytest.raises(ValueRangeError, match="in which the drone moves"):
        source.neighbours(np.random.default_rng(0))


def test_a_flight_that_stays_on_the_ground_is_refused(labelled: Flight) -> None:
    low = [replace(frame, height_above_ground_m=0.7) for frame in labelled.frames]
    with pytest.raises(ValueRangeError, match="fly higher"):
        ClipSource([replace(labelled, frames=tuple(low))])


# --- labels without truth -------------------------------------------------------------------------


class _Exact:
    """A segmenter that knows."""

    def __init__(self, known: KnownFlight) -> None:
        indices = [frame.index for frame in known.footage.frames]
        self._ids = dict(zip(indices, known.ids, strict=True))

    def segment(self, frame: Frame) -> ClassMap:
        return paper_map(ids=self._ids[frame.index], captured_s=frame.captured_s)


def _relative_error(found: np.ndarray, known: KnownFlight, place: int) -> np.ndarray:
    truth = known.depth_m[place]
    counts = np.isfinite(found) & (known.ids[place] > 0)
    return np.abs(found - truth)[counts] / truth[counts]


def _from_flow(known: KnownFlight, others: list[tuple[int, np.ndarray]]) -> np.ndarray:
    """The depth of frame 5 from other frames and their movements."""
    greys = [grey(frame) for frame in known.footage.frames]
    return parallax_depth(greys[5], known.footage.camera, [(greys[j], m) for j, m in others])


# --- parallax -------------------------------------------------------------------------------------


def test_flow_between_known_places_gives_depth(flight: KnownFlight) -> None:
    error = _relative_error(
        _from_flow(flight, [(j, flight.motion(5, j)) for j in (1, 3, 8, 10)]), flight, 5
    )
    assert error.size > 5000
    assert np.median(error) < 0.04


def test_one_other_frame_or_none_that_moved_says_nothing(flight: KnownFlight) -> None:
    for others in ([(9, flight.motion(5, 9))], [(5, np.eye(3, 4))] * 3, []):
        assert np.isnan(_from_flow(flight, others)).all()


def test_frames_that_do_not_fit_their_movements_say_little(flight: KnownFlight) -> None:
    right = [(j, flight.motion(5, j)) for j in (1, 3, 8, 10)]
    wrong = [(j, flight.motion(5, 11 - j)) for j in (1, 3, 8, 10)]
    believed, doubted = (np.isfinite(_from_flow(flight, others)).sum() for others in (right, wrong))
    assert doubted < 0.2 * believed


# --- labels ---------------------------------------------------------------------------------------


def test_ground_contacts_label_ground_and_boxes(flight: KnownFlight) -> None:
    labels = labelling.contact_labels(flight.footage, _Exact(flight))
    assert labels.shape == (12, 2, 128, 160)
    assert np.isnan(labels[4, 0]).all()  # not one of every three
    assert np.isinf(labels[4, 1]).all()
    for place in (0, 6):
        depth = labels[place, 0].astype(np.float32)
        big = cv2.resize(depth, (320, 256), interpolation=cv2.INTER_NEAREST)
        error = _relative_error(big, flight, place)
        assert error.size > 20000
        assert np.median(error) < 0.03


def test_low_frames_get_no_labels(flight: KnownFlight) -> None:
    low = [replace(frame, height_above_ground_m=0.7) for frame in flight.footage.frames]
    low_flight = replace(flight.footage, frames=tuple(low))
    labels = labelling.contact_labels(low_flight, _Exact(flight))
    assert np.isnan(labelling.add_parallax(low_flight, labels)[:, 0]).all()


def test_parallax_fills_gaps_below_the_bound_and_leaves_labels_alone(flight: KnownFlight) -> None:
    labels = np.full((12, 2, 128, 160), np.nan, np.float16)
    labels[:, 1] = np.inf
    labels[:, 0, :20] = 7.0
    labels[:, 1, :, 80:] = 0.1
    filled = labelling.add_parallax(flight.footage, labels)
    assert (filled[:, 0, :20] == 7.0).all()
    assert np.isfinite(filled[6, 0, 20:, :80]).sum() > 1000
    assert np.isnan(filled[6, 0, 20:, 80:]).all()
    assert np.isnan(filled[4, 0, 20:]).all()  # not one of every three
    np.testing.assert_array_equal(filled[:, 1], labels[:, 1])
