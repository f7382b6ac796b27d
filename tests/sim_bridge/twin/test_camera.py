"""Blur, exposure error and noise of the simulated camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim_bridge.twin.camera import Optics
from sim_bridge.twin.profile import Profile

IDEAL = Profile.named("ideal")
GREY = np.full((90, 160, 3), 120, np.uint8)


def test_an_ideal_camera_changes_nothing() -> None:
    """It returns a copy, so that the clean image stays unchanged."""
    result = Optics(IDEAL, 160, 90, 0).degrade(GREY, 3, 1.0)
    assert np.array_equal(result, GREY)
    assert not np.shares_memory(result, GREY)


def test_noise_has_the_asked_strength_no_bias_and_no_pattern() -> None:
    """The standard deviation is as configured; frames are independent; a frame is reproducible."""
    optics = Optics(replace(IDEAL, image_noise_std=5.0), 160, 90, 7)
    first, second = (optics.degrade(GREY, k, 1.0).astype(float) - 120 for k in (1, 2))
    assert first.std() == pytest.approx(5.0, rel=0.05)
    assert abs(first.mean()) < 0.1
    assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.03
    assert np.array_equal(optics.degrade(GREY, 1, 1.0).astype(float) - 120, first)


def test_exposure_scales_and_saturates() -> None:
    """Twice the light doubles grey and clips white."""
    optics = Optics(IDEAL, 160, 90, 0)
    assert np.all(optics.degrade(GREY, 0, 1.1) == 132)
    assert np.all(optics.degrade(GREY + 100, 0, 2.0) == 255)


def test_blur_softens_an_edge_and_keeps_the_mean() -> None:
    """The step at an edge decreases with the width of the blur."""
    edge = np.zeros((90, 160, 3), np.uint8)
    edge[:, 80:] = 200
    blurred = Optics(replace(IDEAL, blur_sigma_px=4.0), 160, 90, 0).degrade(edge, 0, 1.0)
    assert np.abs(np.diff(blurred[45, :, 0].astype(int))).max() < 120
    assert blurred.mean() == pytest.approx(edge.mean(), rel=0.01)
