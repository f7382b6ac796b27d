"""`uav-bt lab calibrate` and `tune-heading`: a camera from photographs, gains from a flight."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Annotated

import click
import numpy as np
from annotated_types import Gt

from behaviours.fly.heading_control import HeadingGains
from perception.camera.calibration import Calibration
from perception.camera.calibration import calibrate as calibrate_camera
from perception.camera.camera_file import write_camera
from perception.camera.image_files import image_files, read_image
from uav_bt.cli.declare import command
from uav_bt.cli.progress import progress_bars
from uav_bt.errors import FileError
from uav_bt.files import did_you_mean_file
from uav_bt.option import Option


@command()
def calibrate(
    images: Annotated[tuple[Path, ...], Option(form="IMAGES...")],
    *,
    square_mm: Annotated[float, Gt(0), Option("Edge of one square of the board.")] = 20.0,
    out: Annotated[Path, Option("The camera file.", path="written")] = Path("camera.yaml"),
) -> None:
    """Calibrate a camera from photographs of a checkerboard.

    IMAGES are photographs or folders of them. The board's layout need not be known: every layout of
    inner corners that the photographs allow is tried, and the camera with the lowest reprojection
    error is kept. A camera that the photographs do not determine is refused. What cannot be used is
    named. The EXIF orientation is ignored: the camera is that of the stored pixels.
    """
    files, foreign = _files(images)
    # As stored: a calibration is of the sensor's pixels, however the phone was held.
    photographs = {
        str(path): partial(read_image, path, colour=False, as_stored=True) for path in files
    }
    with progress_bars() as advance:
        found = calibrate_camera(photographs, square_m=square_mm / 1000.0, advance=advance)
    _print_calibration(found)
    for line in foreign:
        click.echo(f"skipped {line}")
    for warning in found.warnings:
        click.echo(f"warning: {warning}", err=True)
    write_camera(out, found.best)
    click.echo(f"camera file: {out}")


def _files(paths: tuple[Path, ...]) -> tuple[list[Path], list[str]]:
    """Return all images of files and folders, each once, and lines about formats not read."""
    found: dict[Path, None] = {}
    foreign = []
    for path in paths:
        if path.is_dir():
            inside, line = image_files(path)
            found.update(dict.fromkeys(inside))
            foreign += [f"in {path}: {line}"] if line else []
        elif path.is_file():
            found[path] = None
        else:
            raise FileError(path, f"there is no such image{did_you_mean_file(path)}")
    return list(found), foreign


def _print_calibration(found: Calibration) -> None:
    click.echo("layout    images  error, px  error of all corners, px")
    for trial in found.trials:
        kept = "  <- kept" if trial is found.best else ""
        layout = f"{trial.columns}x{trial.rows}"
        click.echo(
            f"{layout:<8}  {len(trial.images):6d}  {trial.error_px:9.3f}  "
            f"{trial.common_error_px:9.3f}{kept}"
        )
    camera = found.best.camera
    click.echo(
        f"{camera.width_px}x{camera.height_px}: focal lengths {camera.fx_px:.2f}, "
        f"{camera.fy_px:.2f} px; centre {camera.cx_px:.2f}, {camera.cy_px:.2f} px; distortion "
        + " ".join(f"{value:.4f}" for value in camera.distortion)
    )
    for name, reason in found.skipped.items():
        click.echo(f"skipped {name}: {reason}")


@command()
def tune_heading(
    record: Annotated[Path, Option(path="read")],
    *,
    out: Annotated[
        Path, Option("The PNG file for the plot.", path="written", suffix=".png")
    ] = Path("heading.png"),
) -> None:
    """Identify the yaw response of a recorded flight and choose gains of the heading loop.

    RECORD is a flight that turned under yaw-rate commands, such as one of survey_and_land.
    """
    from uav_bt.app import heading_tuning as tuning  # noqa: PLC0415 - extras, and slow to import

    series = tuning.yaw_series(record)
    response, residual_rad = tuning.identify(series)
    tick_s = float(np.median(np.concatenate([np.diff(times) for times, _, _ in series])))
    loops = {
        "shipped": tuning.heading_loop(HeadingGains(), response, tick_s),
        "suggested": tuning.suggested_loop(response, tick_s),
    }
    click.echo(
        f"commands every {tick_s:.2f} s, turns of {tuning.commanded_turn_deg(series):.0f} degrees\n"
        f"delay {1000 * response.delay_s:.0f} ms, lag {1000 * response.lag_s:.0f} ms, gain "
        f"{response.gain:.2f}; fits the heading to {math.degrees(residual_rad):.1f} degrees (rms)"
    )
    for name, loop in loops.items():
        p, i, d = loop.gains.proportional, loop.gains.integral, loop.gains.derivative
        click.echo(
            f"{name} gains: P {p:.2f} 1/s, I {i:.3f} 1/s^2, D {d:.3f}; margins "
            f"{loop.gain_margin_db:.1f} dB and {loop.phase_margin_deg:.0f} degrees, crossover "
            f"{loop.crossover_radps:.2f} rad/s"
        )
    tuning.draw(series, response, loops, out)
    click.echo(f"plot: {out}")
