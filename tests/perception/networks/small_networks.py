"""Small networks as ONNX files, for the tests of all that run networks."""

from pathlib import Path
from typing import TypeVar

import numpy as np
import onnx.parser
import torch

from uav_bt.types.arrays import Image

IMAGE = "float[1,3,8,16]"
Net = TypeVar("Net", bound=torch.nn.Module)


def save(
    path: Path, nodes: str, taken: str = IMAGE, given: str = IMAGE, constants: str = ""
) -> Path:
    """Write a network from `x` to `y`, in the text form of ONNX."""
    head = '<ir_version: 9, opset_import: ["" : 17]>'
    inner = f"<{constants}>" if constants else ""
    model = onnx.parser.parse_model(f"{head} net ({taken} x) => ({given} y) {inner} {{{nodes}}}")
    path.write_bytes(model.SerializeToString())
    return path


def shaken(net: Net) -> Net:
    """Return a network with statistics unlike those of a fresh one, and weights that matter."""
    for module in net.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            module.running_mean.uniform_(-0.2, 0.2)
            module.running_var.uniform_(0.3, 1.0)
            torch.nn.init.uniform_(module.weight, 0.5, 1.5)
    return net.eval()


def halves() -> Image:
    """Return an image of 16x8 pixels: the left half green, the right half blue."""
    rgb = np.zeros((8, 16, 3), dtype=np.uint8)
    rgb[:, :8, 1] = 200
    rgb[:, 8:, 2] = 200
    return rgb
