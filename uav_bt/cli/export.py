"""`uav-bt net export`: make the ONNX files that missions fly on from trained weights."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from perception.networks.weights_file import SHIPPED_WEIGHTS
from uav_bt.cli.command import Command
from uav_bt.cli.options import INPUT, RUNS, output_option
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.training_options import Drawn, drawn_options
from uav_bt.learning.exporting import CALIBRATION_VIEWS, Network, Precision, export_network
from uav_bt.plugins import need


def _network_options(command: Callable[..., Any]) -> Callable[..., Any]:
    for option in (
        drawn_options(views=50, seed=5),
        output_option(
            "--out",
            f"The ONNX file; {RUNS}/NETWORK-PRECISION.onnx if not given.",
            suffix=".onnx",
        ),
        click.option(
            "--precision",
            type=click.Choice(["int8", "fp32"]),
            default="int8",
            help="8-bit integers or floats.",
        ),
        click.option(
            "--weights",
            metavar="FILE",
            type=INPUT,
            help="The safetensors file of `uav-bt net train`; the shipped one if not given.",
        ),
    ):
        command = option(command)
    return command


@click.command(cls=Command)
@_network_options
def depth(**options: Any) -> None:
    """Export a depth network."""
    _export("depth", "depth", **options)


@click.command(cls=Command)
@_network_options
def student(**options: Any) -> None:
    """Export a control student. All its shapes are fixed."""
    _export("student", "student", **options)


def _export(
    network: Network,
    name: str,
    *,
    weights: Path | None,
    precision: Precision,
    out: Path | None,
    drawn: Drawn,
) -> None:
    need("train")
    path = out or RUNS / f"{name}-{precision}.onnx"
    plan = drawn.of(CALIBRATION_VIEWS)
    with progress_bars() as advance:
        source = weights or SHIPPED_WEIGHTS / f"{name}.safetensors"
        export_network(
            network,
            source,
            path,
            precision=precision,
            views=plan,
            advance=advance,
        )
    click.echo(f"network in {precision}: {path}, {path.stat().st_size / 1e6:.1f} MB")
