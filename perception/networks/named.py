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

ROLES: Final = ("outside", "ground", "obstacle")
"""Roles of networks by roles, in the order of their scores."""

TEACHER: Final = "teacher"
"""The segmentation without a network: the teacher of the U-Nets."""

CONTACT: Final = "contact"
"""The depth model without a network: masks and ground contact alone."""

_IR_VERSION: Final = b"\x08"  # the first byte of every ONNX file: the key of its first field


def segmentation_file(model: str) -> Path | None:
    """Return the file of a segmentation network; None for the teacher.

    Args:
        model: `ANY`, `SHIPPED_UNET`, an ONNX file, or `TEACHER`.

    Raises:
        UnknownNameError: the name is unknown.
        WeightsError: the file is absent or not ONNX.
    """
    if model == TEACHER:
        return None
    shipped = (ANY, SHIPPED_UNET)
    return _file(model, shipped, "segmentation", (*shipped, TEACHER, "FILE.onnx"))


def depth_file(model: str) -> Path | None:
    """Return the file of a depth network; None for `CONTACT`.

    Args:
        model: one of `SHIPPED_DEPTHS`, an ONNX file, or `CONTACT`.

    Raises:
        UnknownNameError: the name is unknown.
        WeightsError: the file is absent or not ONNX.
    """
    if model == CONTACT:
        return None
    return _file(model, SHIPPED_DEPTHS, "depth", (*SHIPPED_DEPTHS, CONTACT, "FILE.onnx"))


def check_onnx(path: Path, remedy: str) -> None:
    """Check a file's first byte for ONNX; OpenVINO's message for other files is long.

    Args:
        path: the file.
        remedy: command that writes such a file, for the message when the file is absent.

    Raises:
        WeightsError: the file is absent or not ONNX.
    """
    if not path.is_file():
        raise WeightsError(
            path,
            f"there is no such network{did_you_mean_file(path)}; {remedy} writes one",
        )
    with reading(path, WeightsError), path.open("rb") as file:
        head = file.read(len(_IR_VERSION))
    if path.suffix.lower() == ".safetensors":
        raise WeightsError(
            path,
            "holds the weights of a training; missions fly on ONNX files: "
            f"'{path.with_suffix('.onnx').name}', which `uav-bt net train` writes beside it",
        )
    if head != _IR_VERSION:
        raise WeightsError(path, "is not a readable ONNX network")


def _file(model: str, shipped: tuple[str, ...], what: str, known: tuple[str, ...]) -> Path:
    path = SHIPPED_WEIGHTS / f"{model}.onnx" if model in shipped else Path(model)
    if not path.suffix:
        raise UnknownNameError(f"{what} model", model, known)
    check_onnx(path, f"`uav-bt net train {what}`")
    return path
