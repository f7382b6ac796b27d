"""`uav-bt net export`: make the ONNX files that missions fly on from trained weights."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import click

from perception.networks.weights_file import SHIPPED_WEIGHTS
from uav_bt.cli.declare import command
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.shared import RUNS
from uav_bt.cli.training_options import Drawn
from uav_bt.learning.training import CALIBRATION_VIEWS, Network, Precision, export_network
from uav_bt.option import Option
from uav_bt.plugins import need

_Weights = Annotated[
    Path | None,
    Option(
        "The safetensors file of `uav-bt net train`; the shipped one if not given.", path="read"
    ),
]
_Precision = Annotated[Precision, Option("8-bit integers or floats.")]
_Out = Annotated[
    Path | None,
    Option(
        f"The ONNX file; {RUNS}/NETWORK-PRECISION.onnx if not given.",
        path="written",
        suffix=".onnx",
    ),
]
_Drawn = Annotated[Drawn, Option(parts=Drawn)]


@command()
def depth(
    *, weights: _Weights = None, precision: _Precision = "int8", out: _Out = None, drawn: _Drawn
) -> None:
    """Export a depth network."""
    _export("depth", weights, precision, out, drawn)


@command()
def student(
    *, weights: _Weights = None, precision: _Precision = "int8", out: _Out = None, drawn: _Drawn
) -> None:
    """Export a control student. All its shapes are fixed."""
    _export("student", weights, precision, out, drawn)


def _export(
    network: Network, weights: Path | None, precision: Precision, out: Path | None, drawn: Drawn
) -> None:
    need("train")
    path = out or RUNS / f"{network}-{precision}.onnx"
    source = weights or SHIPPED_WEIGHTS / f"{network}.safetensors"
    plan = drawn.of(CALIBRATION_VIEWS)
    with progress_bars() as advance:
        export_network(network, source, path, precision=precision, views=plan, advance=advance)
    click.echo(f"network in {precision}: {path}, {path.stat().st_size / 1e6:.1f} MB")
