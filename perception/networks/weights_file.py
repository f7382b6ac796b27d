"""Weights files: safetensors with a JSON note, replaced in one step, without pickle."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from uav_bt.errors import InputError, WeightsError
from uav_bt.files import did_you_mean_file, parse_json, write_whole

SHIPPED_WEIGHTS: Final = Path(__file__).parents[1] / "weights"
"""The folder of the shipped weights."""

_LEFT_OUT: Final = (
    "an installed package leaves out weights that only exports need; work in a checkout of the "
    "repository, or name a file ({})"
)


def write_weights(
    path: Path, tensors: Mapping[str, NDArray[Any]], *, kind: str, details: Mapping[str, Any]
) -> None:
    """Write arrays by name, the purpose that reading checks, and JSON values."""
    content = save(
        {name: np.ascontiguousarray(tensor) for name, tensor in tensors.items()},
        metadata={"kind": kind, "details": json.dumps(details, sort_keys=True)},
    )
    # The library writes metadata in no fixed order; the same weights are to give the same bytes.
    start = 8 + int.from_bytes(content[:8], "little")
    header = json.dumps(json.loads(content[8:start]), sort_keys=True).encode()
    header += b" " * (-len(header) % 8)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, len(header).to_bytes(8, "little") + header + content[start:])


def read_weights(
    path: Path, *, kind: str, remedy: str
) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Return the arrays by name, and the JSON values; a WeightsError has the remedy."""
    if not path.is_file():
        advice = _LEFT_OUT.format(remedy) if path.parent == SHIPPED_WEIGHTS else remedy
        raise WeightsError(path, f"there are no weights here{did_you_mean_file(path)}; {advice}")
    try:
        with safe_open(path, framework="numpy") as file:
            note = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (no mapping)
        details = parse_json(note.get("details", "{}"))
    except (SafetensorError, OSError, ValueError, InputError) as error:
        raise WeightsError(path, f"the weights are damaged ({error}); {remedy}") from error
    if note.get("kind") != kind:
        raise WeightsError(
            path, f"expected weights of kind '{kind}', got '{note.get('kind')}'; {remedy}"
        )
    return tensors, details
