"""`uav-bt export`: make the ONNX files that missions fly on from trained weights."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import click

from uav_bt.cli.options import output_option, seed_option, views_option
from uav_bt.cli.progress import progress_bars
from uav_bt.plugins import need

__all__ = ["export"]

_RUNS: Final = Path("runs")  # where results go by default; git does not look there


@click.group()
def export() -> None:
    """Make ONNX files from trained weights.

    A network in 8-bit integers takes about half the time of one in floats. What numbers it will
    meet is seen on pictures of the twin.
    """


def _network_options(name: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return the options of a network's export."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in (
            seed_option(5),
            views_option(50),
            output_option("--out", f"The ONNX file; {_RUNS}/{name}-PRECISION.onnx if not given."),
            click.option(
                "--precision",
                type=click.Choice(["int8", "fp32"]),
                default="int8",
                show_default=True,
                help="8-bit integers or floats.",
            ),
            click.option(
                "--weights",
                type=click.Path(dir_okay=False, path_type=Path),
                help="The safetensors file that `uav-bt train` made; the shipped one if not given.",
            ),
        ):
            command = option(command)
        return command

    return decorate


@export.command()
@_network_options("unet")
def segmentation(**options: Any) -> None:
    """Make the ONNX file of a segmentation U-Net."""
    need("train", "onnx")
    from uav_bt.learning.exporting import export_segmentation  # noqa: PLC0415 - late, for --help
    from uav_bt.learning.segmentation import SHIPPED_UNET  # noqa: PLC0415

    _export(export_segmentation, "unet", SHIPPED_UNET, **options)


@export.command()
@_network_options("depth")
def depth(**options: Any) -> None:
    """Make the ONNX file of a depth network."""
    need("train", "onnx")
    from uav_bt.learning.depth import SHIPPED_DEPTH  # noqa: PLC0415 - late, for --help
    from uav_bt.learning.exporting import export_depth  # noqa: PLC0415

    _export(export_depth, "depth", SHIPPED_DEPTH, **options)


@export.command()
@_network_options("student")
def student(**options: Any) -> None:
    """Make the ONNX file of a control student. All its shapes are fixed."""
    need("train", "onnx")
    from uav_bt.learning.exporting import export_student  # noqa: PLC0415 - late, for --help
    from uav_bt.learning.student import SHIPPED_STUDENT  # noqa: PLC0415

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
    from uav_bt.learning.exporting import CALIBRATION_VIEWS  # noqa: PLC0415 - late, for --help

    path = out or _RUNS / f"{name}-{precision}.onnx"
    if path.suffix != ".onnx":
        raise click.UsageError(f"--out must end in .onnx, got '{path}'")
    path.parent.mkdir(parents=True, exist_ok=True)
    plan = replace(
        CALIBRATION_VIEWS, scenes=scenes or CALIBRATION_VIEWS.scenes, views=views, seed=seed
    )
    with progress_bars() as advance:
        write(weights or shipped, path, precision=precision, views=plan, advance=advance)
    click.echo(f"network in {precision}: {path}, {path.stat().st_size / 1e6:.1f} MB")
