"""`uav-bt lab`: scenes of the simulated lab, camera calibration, tuning of the heading loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import click
import cv2
import numpy as np
from numpy.typing import NDArray

from behaviours.fly.heading_control import HeadingGains
from perception.camera.calibration import Calibration
from perception.camera.calibration import calibrate as calibrate_camera
from perception.camera.camera_file import write_camera
from perception.camera.image_files import image_files, read_image
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene, scene_names
from uav_bt.app.film import map_of_scene
from uav_bt.app.flight import check as check_tree
from uav_bt.app.tree_places import drawn_places
from uav_bt.cli.command import Command
from uav_bt.cli.options import INPUT, output_option
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.values import Number
from uav_bt.display.lab_drawing import draw_lab_with_axes
from uav_bt.errors import FileError
from uav_bt.files import did_you_mean_file, writing

_FLIGHT_HEIGHT_M: Final = 1.5  # of the shipped missions: only boxes that reach it are in their way


@click.command(cls=Command)
@click.option("--show", "shown", metavar="SCENE", help="A scene, by name or file, to draw.")
@click.option("--tree", metavar="TREE", help="A mission whose places are drawn, too.")
@output_option("--out", "The PNG file for the map; SCENE.png if not given.", suffix=".png")
def scenes(*, shown: str | None, tree: str | None, out: Path | None) -> None:
    """List the scenes that ship with uav-bt, or list the boxes of one and draw its map."""
    if shown is None:
        given = "--out" if out is not None else "--tree" if tree is not None else None
        if given is not None:
            raise click.UsageError(f"{given} needs --show SCENE")
        for name in scene_names():
            click.echo(f"{name:<16}{_line(load_scene(name))}")
        return
    scene = load_scene(shown)
    path = Path(f"{scene.name}.png") if out is None else out
    lab_map = map_of_scene(scene)
    if tree is not None:
        lab_map = replace(lab_map, places=tuple(drawn_places(check_tree(tree), lab_map.take_off)))
    drawn = draw_lab_with_axes(lab_map, title=scene.name)
    _, png = cv2.imencode(".png", cv2.cvtColor(drawn, cv2.COLOR_RGB2BGR))
    with writing(path):
        path.write_bytes(png.tobytes())
    click.echo(f"{scene.name}: {_line(scene)}\n{_table(scene)}map: {path}")


def _table(scene: Scene) -> str:
    """Return the boxes and objects of a scene, a line for each."""
    lines = ["pattern  class   x, m   y, m  yaw, deg  size, m      height, m"]
    for box in scene.boxes:
        (x_m, y_m), (length_m, width_m, height_m) = box.position_m, box.size_m
        lines.append(
            f"{box.pattern:<7}  {scene.classes.names[scene.class_of(box)]}  {x_m:5.2f}  {y_m:5.2f}"
            f"  {box.yaw_deg:8.1f}  {f'{length_m:.2f} x {width_m:.2f}':<11}  {height_m:9.2f}"
        )
    text = "".join(f"{line}\n" for line in lines) if scene.boxes else ""
    return text + _objects(scene)


def _objects(scene: Scene) -> str:
    """Return the objects of a scene, a line for each."""
    if not scene.placed:
        return ""
    wide = max(len(item.name) for item in scene.placed) + 2
    lines = [f"{'object':<{wide}}{'class':<12}  x, m   y, m  yaw, deg  size, m      height, m"]
    for item in scene.placed:
        (x_m, y_m), (length_m, width_m, height_m) = item.spec.position_m, item.shape.kind.size_m
        lines.append(
            f"{item.name:<{wide}}{scene.classes.names[item.shape.class_id]:<12} {x_m:5.2f}  "
            f"{y_m:5.2f}  {item.spec.yaw_deg:8.1f}  {f'{length_m:.2f} x {width_m:.2f}':<11}  "
            f"{height_m:9.2f}"
        )
    return "".join(f"{line}\n" for line in lines)


def _line(scene: Scene) -> str:
    heights = [box.size_m[2] for box in scene.boxes]
    heights += [item.standing.height_m for item in scene.placed]
    tall = sum(height_m >= _FLIGHT_HEIGHT_M for height_m in heights)
    what = "boxes" if scene.boxes or not scene.placed else "objects"
    span = f", {min(heights):.2f} to {max(heights):.2f} m high" if heights else ""
    pads = [
        f"landing mark at ({x_m:g}, {y_m:g})" for x_m, y_m in (p.position_m for p in scene.pads)
    ]
    wide_m, deep_m = scene.ground.size_m
    start = scene.take_off
    if start.random:
        place = "a random place"
    elif start.position_m is not None:
        place = f"({start.position_m[0]:g}, {start.position_m[1]:g})"
    else:
        place = "the landing mark"
    yaw = "" if start.random else f", yaw {start.yaw_deg:g} deg"
    return (
        f"{wide_m:g} x {deep_m:g} m, {len(heights)} {what}{span} "
        f"({tall} reach {_FLIGHT_HEIGHT_M} m), "
        f"{f'{len(scene.movers)} movers, ' if scene.movers else ''}"
        f"{pads[0] if pads else 'no landing mark'}, take-off from {place}{yaw}"
    )


@click.command(cls=Command)
@click.argument(
    "images", metavar="IMAGES...", nargs=-1, required=True, type=click.Path(path_type=Path)
)
@click.option(
    "--square-mm",
    type=Number(min=0.0, min_open=True),
    default=20.0,
    help="Edge of one square of the board.",
)
@output_option("--out", "The camera file.", default=Path("camera.yaml"))
def calibrate(*, images: tuple[Path, ...], square_mm: float, out: Path) -> None:
    """Calibrate a camera from photographs of a checkerboard.

    IMAGES are photographs or folders of them. The board's layout need not be known: every layout of
    inner corners that the photographs allow is tried, and the camera with the lowest reprojection
    error is kept. A camera that the photographs do not determine is refused. What cannot be used is
    named. The EXIF orientation is ignored: the camera is that of the stored pixels.
    """
    files, foreign = _files(images)
    photographs = {str(path): _reader(path) for path in files}
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
    """Return all images of files and folders, each once, and lines about formats not read.

    Raises:
        FileError: a path is absent, or a folder holds no image.
    """
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


def _reader(path: Path) -> Callable[[], NDArray[np.uint8]]:
    # As stored: a calibration is of the sensor's pixels, however the phone was held.
    return lambda: read_image(path, colour=False, as_stored=True)


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


@click.command(cls=Command)
@click.argument("record", type=INPUT)
@output_option("--out", "The PNG file for the plot.", suffix=".png", default=Path("heading.png"))
def tune_heading(*, record: Path, out: Path) -> None:
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
