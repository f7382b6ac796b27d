"""A network's weights as a file: safetensors, the source of truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perception.networks.weights_file import read_weights, write_weights
from uav_bt.errors import WeightsError

__all__ = ["load_tensors", "save_network"]


def save_network(path: Path, net: Any, *, kind: str, details: Mapping[str, Any]) -> None:
    """Write a network's weights and its shape.

    Args:
        path: the safetensors file.
        net: a torch module with a `config` (not named in the signature: this imports no torch).
        kind: of network.
        details: what else to keep, anything JSON can hold.
    """
    tensors = {
        name: tensor.detach().numpy()
        for name, tensor in net.state_dict().items()
        if not name.endswith("num_batches_tracked")
    }
    write_weights(path, tensors, kind=kind, details={"config": asdict(net.config), **details})


def load_tensors(
    path: Path, *, kind: str, cure: str
) -> tuple[dict[str, NDArray[np.float32]], dict[str, Any]]:
    """Return a network's weights by name and what was kept with them.

    Raises:
        WeightsError: the file is absent, damaged, of another kind, or holds NaN or infinity.
    """
    tensors, details = read_weights(path, kind=kind, cure=cure)
    broken = [name for name, tensor in tensors.items() if not np.isfinite(tensor).all()]
    if broken:
        raise WeightsError(path, f"the weights hold NaN or infinity ({broken[0]}); {cure}")
    return tensors, details
