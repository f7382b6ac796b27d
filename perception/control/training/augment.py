"""Changes to windows that leave what to do the same, or mirror it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.control.ego_state import mirrored
from perception.control.training.samples import Batch


@dataclass(frozen=True, kw_only=True)
class ControlAugmentConfig:
    """How much windows are changed."""

    mirror: float = 0.5  # share of windows: the lab and its rules have no handedness
    gain: float = 0.3  # of brightness, relative, either way: lamps differ
    tint: float = 0.06  # of each colour, relative: white balances differ
    exposure: float = 0.05  # of each view, relative: the automatic exposure hunts
    noise: float = 3.0  # standard deviation in grey levels, at most


def augmented(batch: Batch, rng: np.random.Generator, config: ControlAugmentConfig) -> Batch:
    """Return windows changed at random; those given are left alone.

    Args:
        batch: the windows.
        rng: draws the changes.
        config: how much they are changed.
    """
    count, views = batch.frames.shape[:2]
    flipped: NDArray[np.bool_] = np.asarray(rng.random(count) < config.mirror)
    frames = np.where(flipped[:, None, None, None, None], batch.frames[..., ::-1, :], batch.frames)
    labels = batch.labels.copy()
    labels[flipped, 1] *= -1.0
    state = np.where(flipped[:, None], mirrored(batch.state), batch.state)
    return Batch(
        frames=_relit(frames, rng, config, (count, views)),
        state=state.astype(np.float32),
        labels=labels,
        turning=np.where(flipped, -batch.turning, batch.turning).astype(np.float32),
    )


def _relit(
    frames: NDArray[np.uint8],
    rng: np.random.Generator,
    config: ControlAugmentConfig,
    shape: tuple[int, int],
) -> NDArray[np.uint8]:
    count, views = shape
    gain = np.exp(rng.uniform(-config.gain, config.gain, (count, 1, 1, 1, 1)))
    tint = np.exp(rng.uniform(-config.tint, config.tint, (count, 1, 1, 1, 3)))
    exposure = np.exp(rng.uniform(-config.exposure, config.exposure, (count, views, 1, 1, 1)))
    noise = rng.uniform(0.0, config.noise, (count, 1, 1, 1, 1)).astype(np.float32)
    grain = rng.standard_normal(frames.shape, dtype=np.float32) * noise
    changed = frames * (gain * tint * exposure).astype(np.float32) + grain
    return np.clip(np.rint(changed), 0.0, 255.0).astype(np.uint8)
