"""Labels of one frame: the plane sweep and the horizon."""

from __future__ import annotations

import numpy as np
import pytest

from perception.segmentation.geometry.labels import GROUND, NOT_GROUND, UNKNOWN
from perception.segmentation.geometry.plane_sweep import OtherFrame, homography, sweep
from perception.segmentation.geometry.sightings import above_horizon, sighted
from tests.perception.segmentation.geometry.floor_and_wall import frame, motion, view
from uav_bt.errors import ShapeError
from uav_bt.types.projection import project


def _labels(places_m: tuple[float, ...], contrast: float = 1.0) -> np.ndarray:
    others = [
        OtherFrame(
            grey=frame(place_m, contrast=contrast, seed=index + 1)[0],
            motion=motion(place_m),
            before=place_m < 0.0,
        )
        for index, place_m in enumerate(places_m)
    ]
    reference, _ = frame(0.0, contrast=contrast)
    return sighted(sweep(reference, view(), others), view())


def test_floor_and_wall_have_different_labels() -> None:
    labels, floor = _labels((-0.3, 0.3)), frame(0.0)[1]
    ground, other = labels == GROUND, labels == NOT_GROUND
    assert np.mean(floor[ground]) > 0.93
    assert np.mean(~floor[other]) > 0.98
    assert np.mean(ground[floor]) > 0.25
    assert np.mean(other[~floor]) > 0.7


def test_the_sky_is_never_ground() -> None:
    labels, sky = _labels((0.3,), contrast=0.0), above_horizon(view())
    assert sky.any()
    assert (labels[sky] == NOT_GROUND).all()


def test_without_texture_nothing_below_the_horizon_is_known() -> None:
    labels, sky = _labels((-0.3, 0.3), contrast=0.0), above_horizon(view())
    assert np.mean(labels[~sky] == UNKNOWN) > 0.999


def test_without_a_movement_nothing_below_the_horizon_is_known() -> None:
    labels, sky = _labels((0.0,)), above_horizon(view())
    assert (labels[~sky] == UNKNOWN).all()


def test_brightness_changes_no_label() -> None:
    reference, _ = frame(0.0)
    grey = frame(0.3, seed=1)[0]
    shown = [
        sighted(
            sweep(reference, view(), [OtherFrame(grey=each, motion=motion(0.3), before=False)]),
            view(),
        )
        for each in (grey, (grey - 10.0).astype(np.float32))
    ]
    assert np.mean(shown[0] == shown[1]) > 0.99


def test_the_homography_of_the_ground_moves_ground_points() -> None:
    below_m = 1.5
    axes_view = view()
    moved = motion(0.4)
    point = np.array([2.0, 0.1, below_m])  # forward, right, down
    here = project(point, axes_view.camera, axes_view.pitch_rad)
    there = project(point - [0.0, 0.4, 0.0], axes_view.camera, axes_view.pitch_rad)
    warped = homography(axes_view, moved, 0.0) @ [*here, 1.0]
    np.testing.assert_allclose(warped[:2] / warped[2], there, atol=1e-6)


def test_frames_of_another_size_are_refused() -> None:
    reference, _ = frame(0.0)
    other = OtherFrame(grey=reference[:, :-1], motion=motion(0.3), before=True)
    with pytest.raises(ShapeError, match="frame of a plane sweep must be 112x224"):
        sweep(reference, view(), [other])
    with pytest.raises(ShapeError, match="other frames of a plane sweep"):
        sweep(reference, view(), [])
