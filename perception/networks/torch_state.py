"""Torch's states as named arrays, and memory laid out for the CPU. Imports torch: training only."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, TypeVar

import torch
from numpy.typing import NDArray
from torch import Tensor, nn

__all__ = ["channels_last", "follow_mean", "named_arrays", "tensors_under", "warm_cosine"]

Module = TypeVar("Module", bound=nn.Module)


def channels_last(net: Module) -> Module:
    """Lay a network's weights out as the CPU likes them: a third faster."""
    # Not `net.to(memory_format=...)`: torch's stubs do not know it.
    for parameter in net.parameters():
        if parameter.ndim == 4:
            parameter.data = parameter.data.contiguous(memory_format=torch.channels_last)
    return net


def named_arrays(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, NDArray[Any]]:
    """Return tensors as arrays, their names behind a prefix."""
    return {f"{prefix}/{name}": tensor.detach().numpy() for name, tensor in tensors.items()}


def tensors_under(prefix: str, arrays: Mapping[str, NDArray[Any]]) -> dict[str, Tensor]:
    """Return the arrays behind a prefix as tensors of their own."""
    start = f"{prefix}/"
    return {
        name.removeprefix(start): torch.from_numpy(array.copy())
        for name, array in arrays.items()
        if name.startswith(start)
    }


def warm_cosine(step: int, *, warm_up: int, steps: int) -> float:
    """Return the share of the peak learning rate: a linear rise times half a cosine to nothing."""
    rise = min(1.0, (step + 1) / warm_up)
    return rise * 0.5 * (1.0 + math.cos(math.pi * step / steps))


@torch.no_grad()
def follow_mean(mean: nn.Module, net: nn.Module, *, most: float, step: int) -> None:
    """Let the running mean of a network's weights follow them.

    Args:
        mean: a network of the same shape, changed in place.
        net: the one that learns.
        most: decay of the mean. The early mean forgets faster, so that it does not drag the first
            random weights along.
        step: how many steps were done.
    """
    decay = min(most, step / (step + 10.0))
    ours = net.state_dict()
    for name, value in mean.state_dict().items():
        if value.is_floating_point():
            value.lerp_(ours[name], 1.0 - decay)
        else:
            value.copy_(ours[name])
