"""Weights files: safetensors with a JSON note, replaced in one step, without pickle.

It also finds the networks that tree files name, and imports no inference runtime.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from uav_bt.errors import InputError, UnknownNameError, WeightsError
from uav_bt.files import did_you_mean_file, parse_json, reading, write_whole

SHIPPED_WEIGHTS: Final = Path(__file__).parents[1] / "weights"  # the folder
SHIPPED_UNET: Final = "unet"  # the shipped U-Net, in 8-bit integers
ANY: Final = "any"  # the shipped network for any room: roles and relative depth by one inference
SHIPPED_DEPTHS: Final = ("depth", ANY)  # in 8-bit integers, and the second head of `any`
TEACHER: Final = "teacher"  # the segmentation without a network: the teacher of the U-Nets
CONTACT: Final = "contact"  # the depth model without a network: masks and ground contact alone
_IR_VERSION: Final = b"\x08"  # the first byte of every ONNX file: the key of its first field
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


# --- names in tree files --------------------------------------------------------------------------


def segmentation_file(model: str) -> Path | None:
    """Return the file of a segmentation network by its name or path; None for `TEACHER`."""
    return _file(model, (ANY, SHIPPED_UNET), "segmentation", TEACHER)


def depth_file(model: str) -> Path | None:
    """Return the file of a depth network by its name or path; None for `CONTACT`."""
    return _file(model, SHIPPED_DEPTHS, "depth", CONTACT)


def check_onnx(path: Path, remedy: str) -> None:
    """Check a file's first byte for ONNX; OpenVINO's message for other files is long.

    `remedy` is the command that writes such a file.
    """
    if not path.is_file():
        raise WeightsError(
            path, f"there is no such network{did_you_mean_file(path)}; {remedy} writes one"
        )
    if path.suffix.lower() == ".safetensors":
        raise WeightsError(
            path,
            "holds the weights of a training; missions fly on ONNX files: "
            f"'{path.with_suffix('.onnx').name}', which `uav-bt net train` writes beside it",
        )
    with reading(path, WeightsError), path.open("rb") as file:
        if file.read(1) != _IR_VERSION:
            raise WeightsError(path, "is not a readable ONNX network")


def _file(model: str, shipped: tuple[str, ...], what: str, without: str) -> Path | None:
    if model == without:
        return None
    path = SHIPPED_WEIGHTS / f"{model}.onnx" if model in shipped else Path(model)
    if not path.suffix:
        raise UnknownNameError(f"{what} model", model, (*shipped, without, "FILE.onnx"))
    check_onnx(path, f"`uav-bt net train {what}`")
    return path
