"""`uav-bt net export`: make the ONNX files that missions fly on from trained weights."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from uav_bt.cli.options import INPUT, RUNS, output_option, seed_option, views_option
from uav_bt.cli.progress import progress_bars
from uav_bt.learning.depth import SHIPPED_DEPTH
from uav_bt.learning.exporting import (
    CALIBRATION_VIEWS,
    export_depth,
    export_segmentation,
    export_student,
)
from uav_bt.learning.segmentation import SHIPPED_UNET
from uav_bt.learning.student import SHIPPED_STUDENT
from uav_bt.plugins import need

__all__ = ["depth", "segmentation", "student"]


def _network_options(command: Callable[..., Any]) -> Callable[..., Any]:
    for option in (
        seed_option(5),
        views_option(50),
        output_option(
            "--out",
            f"The ONNX file; {RUNS}/NETWORK-PRECISION.onnx if not given.",
            suffix=".onnx",
        ),
        click.option(
            "--precision",
            type=click.Choice(["int8", "fp32"]),
            default="int8",
            show_default=True,
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


@click.command()
@_network_options
def segmentation(**options: Any) -> None:
    """Export a segmentation U-Net."""
    _export(export_segmentation, "unet", SHIPPED_UNET, **options)


@click.command()
@_network_options
def depth(**options: Any) -> None:
    """Export a depth network."""
    _export(export_depth, "depth", SHIPPED_DEPTH, **options)


@click.command()
@_network_options
def student(**options: Any) -> None:
    """Export a control student. All its shapes are fixed."""
    _export(export_student, "student", SHIPPED_STUDENT, **options)


def _export(
    write: Callable[..., None],
    name: str,
    shipped: Path,
    *,
    weights: Path | None,
    precision: str,
    out: Path | None,
    scenes: tuple[str, ...],
    views: int,
    seed: int,
) -> None:
    need("train", "onnx")
    path = out or RUNS / f"{name}-{precision}.onnx"
    path.parent.mkdir(parents=True, exist_ok=True)
    plan = replace(
        CALIBRATION_VIEWS, scenes=scenes or CALIBRATION_VIEWS.scenes, views=views, seed=seed
    )
    with progress_bars() as advance:
        write(weights or shipped, path, precision=precision, views=plan, advance=advance)
    click.echo(f"network in {precision}: {path}, {path.stat().st_size / 1e6:.1f} MB")
