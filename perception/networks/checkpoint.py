"""The whole state of a training run in one file. Imports torch: training only."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import torch
from numpy.typing import NDArray
from torch import nn

from perception.networks.torch_state import named_arrays, tensors_under
from perception.networks.weights_file import read_weights, write_weights
from uav_bt.errors import WeightsError

__all__ = ["Checkpoint"]

_CURE: Final = "delete the file to start the run anew"


@dataclass(frozen=True, kw_only=True, eq=False)
class Checkpoint:
    """What a checkpoint holds: networks by name, the optimiser, and whose run it is."""

    kind: str  # of the file
    about: str  # the run's settings; a checkpoint of others is refused
    modules: Mapping[str, nn.Module]
    optimiser: torch.optim.Optimizer

    def save(self, path: Path, step: int) -> None:
        """Write the state after so many steps."""
        tensors: dict[str, NDArray[Any]] = {}
        for name, module in self.modules.items():
            tensors |= named_arrays(name, module.state_dict())
        for index, state in self.optimiser.state_dict()["state"].items():
            tensors |= named_arrays(f"optimiser/{index}", state)
        write_weights(path, tensors, kind=self.kind, details={"step": step, "about": self.about})

    def load(self, path: Path) -> int:
        """Take a state over and return how many steps were done.

        Raises:
            WeightsError: it is damaged, or belongs to a run with other settings or other data.
        """
        tensors, details = read_weights(path, kind=self.kind, cure=_CURE)
        if details.get("about") != self.about:
            raise WeightsError(path, f"belongs to a run with other settings or data; {_CURE}")
        try:
            for name, module in self.modules.items():
                module.load_state_dict(tensors_under(name, tensors))
            whole = self.optimiser.state_dict()
            count = sum(len(group["params"]) for group in whole["param_groups"])
            whole["state"] = {i: tensors_under(f"optimiser/{i}", tensors) for i in range(count)}
            self.optimiser.load_state_dict(whole)
            return int(details["step"])
        except (KeyError, ValueError, RuntimeError) as error:
            raise WeightsError(path, f"is not a whole checkpoint ({error}); {_CURE}") from error
