"""Lookup of networks by their names in tree files; imports no inference runtime."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from perception.networks.weights_file import SHIPPED_WEIGHTS
from uav_bt.errors import UnknownNameError, WeightsError
from uav_bt.files import did_you_mean_file, reading

SHIPPED_UNET: Final = "unet"
"""The shipped U-Net, in 8-bit integers."""

ANY: Final = "any"
"""The shipped network for any room: roles and relative depth by one inference."""

SHIPPED_DEPTHS: Final = ("depth", ANY)
"""The shipped depth networks: one in 8-bit integers, and the second head of `any`."""

TEACHER: Final = "teacher"
"""The segmentation without a network: the teacher of the U-Nets."""

CONTACT: Final = "contact"
"""The depth model without a network: masks and ground contact alone."""

_IR_VERSION: Final = b"\x08"  # the first byte of every ONNX file: the key of its first field


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
