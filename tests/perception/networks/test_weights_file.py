"""Weights files: damaged files give one clear error."""

from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save_file

from perception.networks.weights_file import read_weights, write_weights
from uav_bt.errors import WeightsError


@pytest.mark.parametrize("details", ["{", "[" * 100_000, "1e999", "9" * 5000])
def test_damaged_details_are_refused(tmp_path: Path, details: str) -> None:
    path = tmp_path / "net.safetensors"
    save_file({"a": np.zeros(1)}, path, metadata={"kind": "unet", "details": details})
    with pytest.raises(WeightsError, match=r"damaged \(no JSON.*; train it"):
        read_weights(path, kind="unet", remedy="train it")


def test_the_same_weights_are_the_same_bytes(tmp_path: Path) -> None:
    files = [tmp_path / f"{number}.safetensors" for number in range(8)]
    for file in files:
        write_weights(file, {"w": np.arange(3.0)}, kind="u-net", details={"steps": 2})
    assert len({file.read_bytes() for file in files}) == 1
    tensors, details = read_weights(files[0], kind="u-net", remedy="")
    assert list(tensors["w"]) == [0.0, 1.0, 2.0]
    assert details == {"steps": 2}
