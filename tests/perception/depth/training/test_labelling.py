"""Labels without truth: triangulated flow, ground contacts, and the exact ones to compare with."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from perception.depth.training import labelling
from perception.depth.training.footage import grey
from perception.depth.training.labelling import parallax_depth
from tests.paper_lab import paper_map
from tests.perception.depth.depth_flight import KnownFlight, known_flight
from uav_bt.types import ClassMap, Frame


@pytest.fixture(scope="module")
def known() -> KnownFlight:
    return known_flight()


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


def test_flow_between_known_places_gives_depth(known: KnownFlight) -> None:
    error = _relative_error(
        _from_flow(known, [(j, known.motion(5, j)) for j in (1, 3, 8, 10)]), known, 5
    )
    assert error.size > 5000
    assert np.median(error) < 0.04


def test_one_other_frame_or_none_that_moved_says_nothing(known: KnownFlight) -> None:
    for others in ([(9, known.motion(5, 9))], [(5, np.eye(3, 4))] * 3, []):
        assert np.isnan(_from_flow(known, others)).all()


def test_frames_that_do_not_fit_their_movements_say_little(known: KnownFlight) -> None:
    right = [(j, known.motion(5, j)) for j in (1, 3, 8, 10)]
    wrong = [(j, known.motion(5, 11 - j)) for j in (1, 3, 8, 10)]
    believed, doubted = (np.isfinite(_from_flow(known, others)).sum() for others in (right, wrong))
    assert doubted < 0.2 * believed


# --- labels ---------------------------------------------------------------------------------------


def test_ground_contacts_label_ground_and_boxes(known: KnownFlight) -> None:
    labels = labelling.contact_labels(known.footage, _Exact(known))
    assert labels.shape == (12, 2, 128, 160)
    assert np.isnan(labels[4, 0]).all()  # not one of every three
    assert np.isinf(labels[4, 1]).all()
    for place in (0, 6):
        depth = labels[place, 0].astype(np.float32)
        big = cv2.resize(depth, (320, 256), interpolation=cv2.INTER_NEAREST)
        error = _relative_error(big, known, place)
        assert error.size > 20000
        assert np.median(error) < 0.03


def test_low_frames_get_no_labels(known: KnownFlight) -> None:
    low = [replace(frame, height_above_ground_m=0.7) for frame in known.footage.frames]
    flight = replace(known.footage, frames=tuple(low))
    labels = labelling.contact_labels(flight, _Exact(known))
    assert np.isnan(labelling.add_parallax(flight, labels)[:, 0]).all()


def test_parallax_fills_gaps_below_the_bound_and_leaves_labels_alone(known: KnownFlight) -> None:
    labels = np.full((12, 2, 128, 160), np.nan, np.float16)
    labels[:, 1] = np.inf
    labels[:, 0, :20] = 7.0
    labels[:, 1, :, 80:] = 0.1
    filled = labelling.add_parallax(known.footage, labels)
    assert (filled[:, 0, :20] == 7.0).all()
    assert np.isfinite(filled[6, 0, 20:, :80]).sum() > 1000
    assert np.isnan(filled[6, 0, 20:, 80:]).all()
    assert np.isnan(filled[4, 0, 20:]).all()  # not one of every three
    np.testing.assert_array_equal(filled[:, 1], labels[:, 1])


def test_labels_come_back_as_they_were_written(tmp_path: Path) -> None:
    labels = np.full((2, 2, 4, 5), np.nan, np.float16)
    labels[0, 0], labels[:, 1] = 1.5, np.inf
    labelling.write_labels(tmp_path / "l.npz", labels)
    np.testing.assert_array_equal(labelling.read_labels(tmp_path / "l.npz"), labels)
