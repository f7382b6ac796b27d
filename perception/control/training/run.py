"""Training of the control student on windows of flights: augmentation, loss and run.

Importing this module imports torch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F  # noqa: N812 - everybody's name for it

from perception.control.ego_state import ControlNetConfig, mirrored
from perception.control.runtime import ControlEstimate, decode
from perception.control.training.network import ControlNet
from perception.control.training.samples import Batch, ControlSamples
from perception.networks.training import loop
from uav_bt.types.arrays import Flags, Floats32, Image

# Weight of blocked paths. A free path taken for blocked costs a turn; a blocked path taken for free
# may cost the drone.
_CAUTION: Final = 1.5
# Learnt quantile of lengths. Too short a step costs a stop; too long a step costs more.
_QUANTILE: Final = 0.35
_SIDE, _METRES, _ENDS = 0.5, 2.0, 0.5
_MIRROR: Final = 0.5  # share of mirrored windows; lab and rules are symmetric
_GAIN: Final = 0.3  # relative brightness in both directions: lamps differ
_TINT: Final = 0.06  # relative gain of each colour: white balances differ
_EXPOSURE: Final = 0.05  # relative brightness of each view: automatic exposure varies
_NOISE: Final = 3.0  # largest standard deviation, grey levels


def choice_loss(prediction: Tensor, labels: Tensor, turning: Tensor) -> Tensor:
    """Return the loss of the choice between advance and turn, and of side, lengths and edge.

    Predictions are `ego_state.OUTPUTS`, (N, 5), labels and turns those of `Batch`. A squared error
    of the movement would give the mean of an advance and a turn where both are likely, which is
    neither.
    """
    forward_m, yaw_rad, ends, free_m = labels.unbind(dim=1)
    advances = (forward_m > 0.0).float()
    choice = F.binary_cross_entropy_with_logits(
        prediction[:, 0], advances, weight=torch.where(advances > 0.0, 1.0, _CAUTION)
    )
    # A turn under way keeps its side, so it does not train the choice of the side.
    begins = (forward_m <= 0.0) & (turning == 0.0)
    side = F.binary_cross_entropy_with_logits(
        prediction[:, 1], (yaw_rad > 0.0).float(), weight=begins.float()
    )
    step = _pinball(prediction[:, 2], forward_m, forward_m > 0.0)
    edge = F.binary_cross_entropy_with_logits(prediction[:, 3], ends)
    free = _pinball(prediction[:, 4], free_m, torch.isfinite(free_m))
    return choice + _SIDE * side + _METRES * (step + free) + _ENDS * edge


def _pinball(prediction: Tensor, truth: Tensor, counts: Tensor) -> Tensor:
    """Return the loss whose minimum is at a quantile (Koenker and Bassett, 1978)."""
    left = torch.where(counts, truth - prediction, 0.0)
    return torch.maximum(_QUANTILE * left, (_QUANTILE - 1.0) * left).mean()


def mirrored_windows(batch: Batch, flipped: Flags) -> Batch:
    """Return windows of which some, (N,), are those of a mirrored world."""
    labels = batch.labels.copy()
    labels[flipped, 1] *= -1.0
    frames = np.where(flipped[:, None, None, None, None], batch.frames[..., ::-1, :], batch.frames)
    state = np.where(flipped[:, None], mirrored(batch.state), batch.state)
    turning = np.where(flipped, -batch.turning, batch.turning)
    return Batch(frames=frames, state=state, labels=labels, turning=turning)


def relit(frames: Image, rng: np.random.Generator) -> Image:
    """Return views, (N, V, H, W, 3), in other light and with the noise of a sensor."""
    count, views = frames.shape[:2]
    gain = np.exp(rng.uniform(-_GAIN, _GAIN, (count, 1, 1, 1, 1)))
    tint = np.exp(rng.uniform(-_TINT, _TINT, (count, 1, 1, 1, 3)))
    exposure = np.exp(rng.uniform(-_EXPOSURE, _EXPOSURE, (count, views, 1, 1, 1)))
    noise = rng.uniform(0.0, _NOISE, (count, 1, 1, 1, 1)).astype(np.float32)
    grain = rng.standard_normal(frames.shape, dtype=np.float32) * noise
    changed = frames * (gain * tint * exposure).astype(np.float32) + grain
    return np.clip(np.rint(changed), 0.0, 255.0).astype(np.uint8)


@dataclass(frozen=True, kw_only=True)
class ControlTrainingConfig(loop.LoopConfig):
    """How the control student is trained."""

    steps: int = 6000
    batch: int = 24  # windows per step
    learning_rate: float = 2e-3  # peak; AdamW
    weight_decay: float = 1e-3
    warm_up_steps: int = 200
    dropout: float = 0.2  # of each view's embedding, against reliance on single values
    average: float = 0.995
    near_weight: float = 2.0  # how much more often views near obstacles are drawn


def train_control(
    samples: ControlSamples,
    config: ControlTrainingConfig,
    net_config: ControlNetConfig,
    *,
    start: Mapping[str, Floats32] | None = None,
    checkpoint: Path | None = None,
    progress: Callable[[loop.Progress, ControlNet], None] | None = None,
) -> ControlNet:
    """Return the network with the running mean of its weights, in evaluation mode.

    It begins with the layers of `start` that fit, others at random, and continues from the
    checkpoint if there is one. Progress is told after every step.
    """
    torch.manual_seed(config.seed)
    net = loop.channels_last(ControlNet(net_config, dropout=config.dropout))
    with torch.no_grad():
        for name, value in net.state_dict().items():
            given = (start or {}).get(name)
            if given is not None and given.shape == tuple(value.shape):
                value.copy_(torch.from_numpy(np.array(given)))

    def objective(rng: np.random.Generator) -> tuple[Tensor, Mapping[str, Tensor]]:
        torch.manual_seed(int(rng.integers(2**31)))  # of the dropout
        drawn = samples.draw(rng, config.batch)
        batch = mirrored_windows(drawn, rng.random(config.batch) < _MIRROR)
        numbers = map(torch.from_numpy, (batch.state, batch.labels, batch.turning))
        state, labels, turning = (tensor.to(config.device) for tensor in numbers)
        frames = _planes(relit(batch.frames, rng)).to(config.device)
        return choice_loss(net(frames, state), labels, turning), {}

    about = {"training": asdict(config), "net": asdict(net_config), "windows": len(samples)}
    return loop.train(
        net, objective, config, "control", about, checkpoint=checkpoint, progress=progress
    )


def predict_control(net: ControlNet, batch: Batch) -> list[ControlEstimate]:
    """Return the network's estimates for the windows of a batch."""
    net.eval()
    with torch.inference_mode():
        device = next(net.parameters()).device
        state = torch.from_numpy(batch.state).to(device)
        predictions: Tensor = net(_planes(batch.frames).to(device), state)
    return [decode(prediction) for prediction in predictions.cpu().numpy()]


def _planes(frames: Image) -> Tensor:
    return torch.from_numpy(frames).permute(0, 1, 4, 2, 3).float().div_(255.0)
