"""Labels without truth: triangulated flow, ground contacts, and the exact ones to compare with."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from perception.depth.training import labelling
from perception.depth.training.clips import DepthLabels
from perception.depth.training.parallax import Parallax, ParallaxConfig
from tests.paper_lab import paper_map
from tests.perception.depth.depth_flight import KnownFlight, known_flight
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.types import CameraModel, ClassMap, Frame


@pytest.fixture(scope="module")
def known() -> KnownFlight:
    return known_flight()


class _Exact:
    """A segmenter that knows."""

    def __init__(self, known: KnownFlight) -> None:
        self._ids = dict(zip(known.footage.index.tolist(), known.ids, strict=True))

    def segment(self, frame: Frame) -> ClassMap:
        return paper_map(ids=self._ids[frame.index], captured_s=frame.captured_s)


def _grey(known: KnownFlight, place: int) -> np.ndarray:
    return np.asarray(cv2.cvtColor(known.footage.frames[place], cv2.COLOR_RGB2GRAY))


def _relative_error(found: np.ndarray, known: KnownFlight, place: int) -> np.ndarray:
    truth = known.depth_m[place]
    counts = np.isfinite(found) & (known.ids[place] > 0)
    return np.abs(found - truth)[counts] / truth[counts]


def _parallax_depth(
    grey: np.ndarray, others: list[tuple[np.ndarray, np.ndarray]], camera: CameraModel
) -> np.ndarray:
    parallax = Parallax(grey, camera)
    for other, motion in others:
        parallax.add(other, motion)
    return parallax.depth()


# --- parallax -------------------------------------------------------------------------------------


def test_flow_between_known_places_gives_depth(known: KnownFlight) -> None:
    others = [(_grey(known, j), known.motion(5, j)) for j in (1, 3, 8, 10)]
    depth = _parallax_depth(_grey(known, 5), others, known.footage.camera)
    error = _relative_error(depth, known, 5)
    assert error.size > 5000
    assert np.median(error) < 0.04


def test_one_other_frame_is_not_believed(known: KnownFlight) -> None:
    others = [(_grey(known, 9), known.motion(5, 9))]
    assert np.isnan(_parallax_depth(_grey(known, 5), others, known.footage.camera)).all()


def test_frames_from_the_same_place_say_nothing(known: KnownFlight) -> None:
    still = np.eye(3, 4)
    others = [(_grey(known, 5), still)] * 3
    assert np.isnan(_parallax_depth(_grey(known, 5), others, known.footage.camera)).all()


def test_frames_that_do_not_fit_their_movements_say_little(known: KnownFlight) -> None:
    right = [(_grey(known, j), known.motion(5, j)) for j in (1, 3, 8, 10)]
    wrong = [(_grey(known, j), known.motion(5, 11 - j)) for j in (1, 3, 8, 10)]
    camera = known.footage.camera
    believed, doubted = (
        np.isfinite(_parallax_depth(_grey(known, 5), others, camera)).sum()
        for others in (right, wrong)
    )
    assert doubted < 0.2 * believed


def test_a_frame_of_another_size_is_refused(known: KnownFlight) -> None:
    with pytest.raises(ShapeError, match="256x320, as its camera"):
        _parallax_depth(np.zeros((20, 30), np.uint8), [], known.footage.camera)


# --- labels ---------------------------------------------------------------------------------------


def test_ground_contacts_label_ground_and_boxes(known: KnownFlight) -> None:
    labels = labelling.contact_labels(known.footage, _Exact(known), labelling.LabelConfig(every=5))
    assert labels.depth_m.shape == (12, 128, 160)
    big = cv2.resize(
        labels.depth_m[5].astype(np.float32), (320, 256), interpolation=cv2.INTER_NEAREST
    )
    assert np.isnan(labels.depth_m[4]).all()  # not one of every five
    error = _relative_error(big, known, 5)
    assert error.size > 20000
    assert np.median(error) < 0.03


def test_low_frames_get_no_labels(known: KnownFlight) -> None:
    config = labelling.LabelConfig(min_height_m=9.0)
    labels = labelling.contact_labels(known.footage, _Exact(known), config)
    assert np.isnan(labels.depth_m).all()


def test_parallax_fills_gaps_and_leaves_labels_alone(known: KnownFlight) -> None:
    blank = np.full((12, 128, 160), np.nan, np.float16)
    blank[:, :20] = 7.0
    config = labelling.LabelConfig(every=5)
    filled = labelling.add_parallax(known.footage, DepthLabels(depth_m=blank), config).depth_m
    assert (filled[:, :20] == 7.0).all()
    assert np.isfinite(filled[5, 20:]).sum() > 1000
    assert np.isnan(filled[4, 20:]).all()  # not one of every five


def test_parallax_beyond_the_bound_is_not_believed(known: KnownFlight) -> None:
    blank = np.full((12, 128, 160), np.nan, np.float16)
    bound = np.full_like(blank, 0.1)
    labels = DepthLabels(depth_m=blank, at_most_m=bound)
    config = labelling.LabelConfig(every=5)
    assert np.isnan(labelling.add_parallax(known.footage, labels, config).depth_m).all()


def test_labels_of_another_flight_are_refused(known: KnownFlight) -> None:
    with pytest.raises(ShapeError, match="depth labels must be 12xHxW"):
        labelling.add_parallax(
            known.footage, DepthLabels(depth_m=np.zeros((3, 128, 160), np.float16))
        )


def test_frames_come_back_with_their_telemetry(known: KnownFlight) -> None:
    frames = list(labelling.frames_of(known.footage))
    assert len(frames) == 12
    assert frames[4].index == 12
    assert frames[4].height_above_ground_m == known.footage.height_above_ground_m[4]
    assert frames[4].attitude.yaw_rad == known.footage.attitude_rad[4, 2]


def test_no_frames_at_all_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="every and others"):
        replace(labelling.LabelConfig(), others=0)
    assert ParallaxConfig().min_views == 2


@pytest.mark.parametrize("bounded", [True, False])
def test_labels_come_back_as_they_were_written(tmp_path: Path, bounded: bool) -> None:  # noqa: FBT001 (a parameter of pytest)
    depth = np.full((2, 4, 5), np.nan, np.float16)
    depth[0] = 1.5
    bound = np.full_like(depth, np.inf) if bounded else None
    labelling.write_labels(tmp_path / "l.npz", DepthLabels(depth_m=depth, at_most_m=bound))
    read = labelling.read_labels(tmp_path / "l.npz")
    np.testing.assert_array_equal(read.depth_m, depth)
    assert (read.at_most_m is not None) == bounded
