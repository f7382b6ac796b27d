"""Mapping file of a foreign depth network: kind of output, and format of the input image.

The mapping is a YAML file with the network's name, `net.yaml` beside `net.onnx`:

.. code-block:: yaml

    output: disparity         # or depth; MiDaS and Depth Anything give disparity (1/depth)
    input:                    # optional, as in the mapping of a segmentation network
      mean: [123.7, 116.3, 103.5]
      scale: [58.4, 57.1, 57.4]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

from perception.networks.input_format import InputFormat
from uav_bt.errors import WeightsError
from uav_bt.yaml_file import read_yaml

_OURS: Final = ["framework", "weights_sha256"]  # metadata that `uav-bt net train` writes


@dataclass(frozen=True, kw_only=True)
class DepthMapping:
    """Meaning of a depth network's output, and the format of its input image."""

    output: Literal["depth", "disparity"]  # along the optical axis; 1/depth, both up to a factor
    input: InputFormat = field(default_factory=InputFormat)


def depth_mapping(path: Path, model: Any) -> DepthMapping:
    """Return the mapping of a depth network: from the file beside it, or depth for our networks.

    Args:
        path: the ONNX file.
        model: its network.

    Raises:
        FileError: the mapping file is malformed.
        WeightsError: the mapping file is absent, and another tool made the network.
    """
    beside = path.with_suffix(".yaml")
    if beside.is_file():
        return read_yaml(beside, DepthMapping, "mapping of a depth network").value
    if model.has_rt_info(_OURS):
        return DepthMapping(output="depth")
    raise WeightsError(
        path,
        "does not say whether it gives depth or disparity (1/depth), and the two exchange near "
        f"and far; write `output: depth` or `output: disparity` into {beside}",
    )
