"""Training loop of all networks; an interrupted run resumes from its checkpoint."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Generic, NamedTuple, TypeVar, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.optim.lr_scheduler import LambdaLR
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from perception.networks.weights_file import read_weights, write_weights
from uav_bt.errors import ValueRangeError, WeightsError

_REMEDY: Final = "delete the file to start the run anew"

Net = TypeVar("Net", bound=nn.Module)

# Samples a batch; returns the loss and its unweighted terms by name.
Objective = Callable[[np.random.Generator], tuple[Tensor, Mapping[str, Tensor]]]


@dataclass(frozen=True, kw_only=True)
class LoopConfig:
    """Settings of a training run that all networks share."""

    steps: int = 4000
    batch: int = 12  # examples per step
    learning_rate: float = 3e-3  # peak; AdamW
    weight_decay: float = 1e-4
    warm_up_steps: int = 100  # linear rise; half a cosine then falls to zero
    max_norm: float = 5.0  # the gradient is clipped to this norm
    average: float = 0.99  # decay of the running mean of the weights; the run returns that mean
    seed: int = 0  # of the initial weights, the order of the examples and their augmentation
    checkpoint_every: int = 200  # steps
    device: str = "cpu"  # of PyTorch: `cpu`, or `cuda`, where runs repeat up to rounding errors

    def __post_init__(self) -> None:
        if min(self.steps, self.batch, self.checkpoint_every) < 1 or self.learning_rate <= 0.0:
            raise ValueRangeError(
                "steps, batch, checkpoint_every and learning_rate must be positive, got "
                f"{self.steps}, {self.batch}, {self.checkpoint_every}, {self.learning_rate}"
            )
        if not 0.0 <= self.average < 1.0:
            raise ValueRangeError(f"average must lie within 0 and 1, got {self.average}")
        if self.device == "cuda" and not torch.cuda.is_available():
            raise ValueRangeError(
                "device 'cuda' needs a GPU and a PyTorch built for it, and "
                f"PyTorch {torch.__version__} finds none; train on 'cpu'"
            )

    def learning_rate_factor(self, step: int) -> float:
        """Return the share of the peak learning rate at a step, counted from 0."""
        rise = min(1.0, (step + 1) / self.warm_up_steps)
        return rise * 0.5 * (1.0 + math.cos(math.pi * step / self.steps))


class Progress(NamedTuple):
    """The state of a run after a step."""

    step: int  # steps done
    steps: int  # steps in all
    loss: float
    terms: Mapping[str, float]  # unweighted, by name


def channels_last(net: Net) -> Net:
    """Store a network's weights channels-last, which makes CPU convolutions a third faster."""
    net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # not in torch's stubs
    return net


def train(
    net: Net,
    objective: Objective,
    config: LoopConfig,
    kind: str,
    about: Mapping[str, Any],
    *,
    beside: nn.Module | None = None,
    checkpoint: Path | None = None,
    progress: Callable[[Progress, Net], None] | None = None,
) -> Net:
    """Train a network in place, and return the running mean of its weights, on the CPU.

    The objective may use another network that is trained, too (`beside`). The run continues from
    its checkpoint if that exists; one of another kind, or of a run with other settings and data
    (`about`), is refused. Progress gets the averaged network after every step.
    """
    run = _Run(net, beside, config, f"{kind}-checkpoint", json.dumps(about, sort_keys=True))
    step = run.load(checkpoint) if checkpoint is not None and checkpoint.is_file() else 0
    schedule = LambdaLR(run.optimizer, config.learning_rate_factor, last_epoch=step - 1)
    while step < config.steps:
        # The samples depend on seed and step alone, so a resumed run gets the same batches.
        run.learners.train()
        loss, terms = objective(np.random.default_rng((config.seed, step)))
        run.optimizer.zero_grad(set_to_none=True)
        torch.autograd.backward(loss)
        nn.utils.clip_grad_norm_(run.learners.parameters(), config.max_norm)
        run.optimizer.step()
        schedule.step()
        run.mean.update_parameters(net)
        step += 1
        value = float(loss.detach())
        if not math.isfinite(value):
            raise ValueRangeError(
                f"the loss is {value} after {step} steps; lower the learning rate"
            )
        if checkpoint is not None and (step % config.checkpoint_every == 0 or step == config.steps):
            run.save(checkpoint, step)
        if progress is not None:
            shown = {name: float(term.detach()) for name, term in terms.items()}
            progress(Progress(step, config.steps, value, shown), run.averaged())
    return run.averaged().cpu()


class _Run(Generic[Net]):
    """The state of a run: networks, running mean and optimizer."""

    def __init__(
        self, net: Net, beside: nn.Module | None, config: LoopConfig, kind: str, about: str
    ) -> None:
        self._kind, self._about = kind, about
        self.learners = nn.ModuleList([net] if beside is None else [net, beside])
        self.learners.to(config.device)
        self.mean = AveragedModel(net, multi_avg_fn=_running_mean(config.average), use_buffers=True)
        rate = config.learning_rate
        groups = [{"params": list(self.learners.parameters()), "initial_lr": rate}]
        self.optimizer = torch.optim.AdamW(groups, lr=rate, weight_decay=config.weight_decay)

    def averaged(self) -> Net:
        """Return the network of the running mean, in evaluation mode."""
        return cast("Net", self.mean.module.eval())

    def save(self, path: Path, step: int) -> None:
        """Write the whole state after `step` steps."""
        optimizer = self.optimizer.state_dict()["state"]
        states: dict[str, Mapping[str, Tensor]] = {
            "learners": self.learners.state_dict(),
            "mean": self.mean.state_dict(),
            **{f"optimizer/{index}": state for index, state in optimizer.items()},
        }
        tensors = {
            f"{prefix}/{name}": tensor.detach().cpu().numpy()
            for prefix, state in states.items()
            for name, tensor in state.items()
        }
        write_weights(path, tensors, kind=self._kind, details={"step": step, "about": self._about})

    def load(self, path: Path) -> int:
        """Load a state and return the number of steps done."""
        tensors, details = read_weights(path, kind=self._kind, remedy=_REMEDY)
        if details.get("about") != self._about:
            raise WeightsError(path, f"belongs to a run with other settings or data; {_REMEDY}")
        try:
            self.learners.load_state_dict(_under("learners/", tensors))
            self.mean.load_state_dict(_under("mean/", tensors))
            whole = self.optimizer.state_dict()
            count = len(whole["param_groups"][0]["params"])
            whole["state"] = {at: _under(f"optimizer/{at}/", tensors) for at in range(count)}
            self.optimizer.load_state_dict(whole)
            return int(details["step"])
        except (KeyError, ValueError, RuntimeError) as error:
            raise WeightsError(path, f"is not a whole checkpoint ({error}); {_REMEDY}") from error


def _running_mean(max_decay: float) -> Callable[[Any, Any, Any], None]:
    """Return an update of the mean with a faster decay for the first, nearly random weights."""

    def update(mean: Any, current: Any, count: Any) -> None:
        done = int(count) + 1
        decay = min(max_decay, done / (done + 10.0))
        get_ema_multi_avg_fn(decay)(mean, current, count)  # type: ignore[no-untyped-call]

    return update


def _under(start: str, arrays: Mapping[str, NDArray[Any]]) -> dict[str, Tensor]:
    return {
        name.removeprefix(start): torch.from_numpy(array.copy())
        for name, array in arrays.items()
        if name.startswith(start)
    }
