"""`uav-bt lab`: a lab file to begin with, scenes of the twin, a camera's file, heading gains."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Final, Literal

import click
import cv2
import numpy as np

from behaviours.fly.heading_control import HeadingGains
from perception.camera.calibration import Calibration
from perception.camera.calibration import calibrate as calibrate_camera
from perception.camera.camera_file import write_camera
from perception.camera.image_files import image_files, read_image
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene, scene_files
from uav_bt.app.film import map_of_scene
from uav_bt.app.loading import load_mission
from uav_bt.app.options import FlightOptions
from uav_bt.app.place import lab_of, scene_of
from uav_bt.app.scene_places import with_places
from uav_bt.app.site import Site
from uav_bt.cli.declare import command
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.shared import Positive, print_or_write, table
from uav_bt.display.lab_map import MapItem, MapPlace, draw_lab_with_axes
from uav_bt.errors import FileError, InputError
from uav_bt.files import did_you_mean_file, write_whole
from uav_bt.lab.lab import SCENES_FOLDER, Lab
from uav_bt.lab.lab_file import lab_schema
from uav_bt.lab.shipped import load_lab, write_lab
from uav_bt.option import Option

_OF_PLACES: Final = ("lab", "ports", "variables", "params", "leaves")
_FLIGHT_HEIGHT_M: Final = 1.5  # of the shipped missions: only boxes that reach it are in their way


@command()
def new(
    name: str,
    *,
    simulated: bool = False,
    folder: Annotated[Path, Option(form="--in DIR")] = Path("labs"),
) -> None:
    """Write a commented lab file for a place of yours.

    NAME is the place, such as hall: its folder is labs/hall, and --lab hall finds it. A folder that
    exists is not changed.

    Options:
        simulated: Describe a furnished room, and write a scene in it, to fly in the simulation.
        folder: Folder of your labs; it is made if it is absent.
    """
    path = write_lab(name, folder, simulated=simulated)
    call = "fly survey_and_land --drone plain" if simulated else "check land_only"
    beside = f" and {SCENES_FOLDER}/{name}-a.yaml beside it" if simulated else ""
    click.echo(f"written: {path}{beside} (edit, then try: uav-bt {call} --lab {path.parent})")


@command()
def schema(*, out: Annotated[Path | None, Option(path="written", suffix=".json")] = None) -> None:
    """Write a JSON schema of lab files.

    YAML editors complete, explain and check lab files with it. They find it by this line at the
    head of a lab file:

    \b
      # yaml-language-server: $schema=lab.schema.json

    Options:
        out: Write the schema there; it is printed if not given.
    """  # noqa: D301  (click needs the backspace)
    print_or_write(lab_schema(), out)


@command()
def scenes(
    *,
    shown: Annotated[str | None, Option(form="--show SCENE")] = None,
    tree: Annotated[str | None, Option(form="TREE")] = None,
    flight: Annotated[FlightOptions, Option(parts=FlightOptions, only=_OF_PLACES)],
    out: Annotated[Path | None, Option(path="written", suffix=".png")] = None,
) -> bool:
    """List scenes, or list the boxes of one and draw its map.

    Without --show the scenes that ship and those of the labs in labs/ are listed, or those of
    --lab. With --tree the room at each place of the mission is stated, and drawn: its distance from
    the nearest obstacle or edge, and what a drone needs. Exits with 1 where a place has too little.

    Options:
        shown: A scene, by name or file, to draw.
        tree: A mission whose places are drawn, too.
        out: The PNG file for the map; SCENE.png if not given.
    """
    if shown is None:
        given = "--out" if out is not None else "--tree" if tree is not None else None
        if given is not None:
            raise click.UsageError(f"{given} needs --show SCENE")
        listed = flight.lab.scenes if isinstance(flight.lab, Lab) else scene_files()
        click.echo(
            table([(name, _line(name, flight)) for name in listed] or [("no scenes",)], left=2)
        )
        return True
    scene = _scene(shown, flight)
    path = Path(f"{scene.name}.png") if out is None else out
    lab_map = map_of_scene(scene)
    if tree is not None:
        lab_map = with_places(lab_map, load_mission(tree, flight), scene, flight.place or Site())
    drawn = draw_lab_with_axes(lab_map, title=scene.name)
    _, png = cv2.imencode(".png", cv2.cvtColor(drawn, cv2.COLOR_RGB2BGR))
    write_whole(path, png.tobytes())
    click.echo(f"{scene.name}: {_summary(scene)}")
    if lab_map.boxes:
        click.echo(table(_standing(scene, lab_map.boxes), left=2))
    if lab_map.places:
        click.echo(table(_room_rows(lab_map.places), left=4))
    click.echo(f"map: {path}")
    faults = [each.fault for each in lab_map.places if each.fault]
    for fault in faults:
        click.echo(fault, err=True)
    return not faults


def _scene(name: str, flight: FlightOptions) -> Scene:
    """Return a scene by name or file, of the lab if one is given."""
    asked = replace(flight, scene=name)
    scene = load_scene(scene_of(asked) or name)
    lab_of(asked, scene)
    return scene


def _line(name: str, flight: FlightOptions) -> str:
    """Return the summary of a scene, or why it cannot be used."""
    try:
        return _summary(_scene(name, flight))
    except InputError as error:
        return f"refused: {error}"


def _room_rows(places: Sequence[MapPlace]) -> Sequence[tuple[str, ...]]:
    """Return a row for each place of a mission."""
    rows = [("place", "x, m", "y, m", "room")]
    for place in places:
        at = [f"{round(value, 2) + 0.0:.2f}" for value in place.at_m or ()] or ("", "")
        rows.append((place.text, *at, f"{'BAD: ' if place.fault else ''}{place.note}"))
    return rows


def _standing(scene: Scene, shown: Sequence[MapItem]) -> Sequence[tuple[str, ...]]:
    """Return a row for each object of a scene and its map."""
    rows = [("object", "class", "x, m", "y, m", "yaw, deg", "size, m", "height, m")]
    for placed, item in zip(scene.placed, shown, strict=True):
        size = f"{2 * item.half_x_m:.2f} x {2 * item.half_y_m:.2f}"
        where = (f"{item.x_m:.2f}", f"{item.y_m:.2f}", f"{math.degrees(item.yaw_rad):.1f}")
        rows.append((placed.name, item.name, *where, size, f"{item.height_m:.2f}"))
    return rows


def _summary(scene: Scene) -> str:
    heights = [box.height_m for box in map_of_scene(scene).boxes]
    tall = sum(height_m >= _FLIGHT_HEIGHT_M for height_m in heights)
    what = "boxes" if all(spec.is_printed for spec in scene.objects) else "objects"
    span = f", {min(heights):.2f} to {max(heights):.2f} m high" if heights else ""
    movers = f"{len(scene.movers)} movers, " if scene.movers else ""
    mark = "no landing mark"
    if scene.pads:
        mark = "landing mark at ({:g}, {:g})".format(*scene.pads[0].position_m)
    start = scene.take_off
    if start.random:
        place = "a random place"
    elif start.position_m is not None:
        place = "({:g}, {:g}), yaw {:g} deg".format(*start.position_m, start.yaw_deg)
    else:
        place = f"the landing mark, yaw {start.yaw_deg:g} deg"
    return (
        "{:g} x {:g} m, ".format(*scene.ground.size_m) + f"{len(heights)} {what}{span} "
        f"({tall} reach {_FLIGHT_HEIGHT_M} m), {movers}{mark}, take-off from {place}"
    )


@command()
def print_mark(
    lab: str,
    *,
    sheet: Annotated[Literal["a4", "a3"] | None, Option(form="--sheet SIZE")] = None,
    out: Annotated[Path | None, Option(path="written")] = None,
) -> None:
    """Write the print of a lab's landing mark at true size.

    LAB is the lab, as --lab takes it. Print the file at 100 %; the bar below the mark must then be
    10 cm long. Of the kind region the border is printed.

    Options:
        sheet: Spread a large mark over A4 or A3 sheets with crop marks; without it a mark larger
            than A4 gets one page of its size.
        out: A PDF or SVG file, by its suffix; LAB-mark.pdf if not given.
    """
    # Late: matplotlib takes a second to import.
    from uav_bt.app import mark_print  # noqa: PLC0415

    found = load_lab(lab)
    if found.mark is None:
        raise InputError(f"{found.file} states no landing mark: add the key 'mark'")
    path = out or Path(f"{found.name}-mark.pdf")
    pages, size_mm = mark_print.print_mark(found.mark, found.name, path, sheet=sheet)
    click.echo(f"written: {path}; pages: {pages} of " + "{:g} x {:g} mm".format(*size_mm))


@command()
def calibrate(
    images: Annotated[tuple[Path, ...], Option(form="IMAGES...")],
    *,
    square_mm: Positive = 20.0,
    out: Annotated[Path, Option(path="written")] = Path("camera.yaml"),
) -> None:
    """Calibrate a camera from photographs of a checkerboard.

    IMAGES are photographs or folders of them. The board's layout need not be known: every layout of
    inner corners that the photographs allow is tried, and the camera with the lowest reprojection
    error is kept. A camera that the photographs do not determine is refused. What cannot be used is
    named. The EXIF orientation is ignored: the camera is that of the stored pixels.

    Options:
        square_mm: Edge of one square of the board.
        out: The camera file.
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
    rows = [("layout", "images", "error, px", "error of all corners, px", "")]
    for trial in found.trials:
        errors = (f"{trial.error_px:.3f}", f"{trial.common_error_px:.3f}")
        kept = "<- kept" if trial is found.best else ""
        rows.append((f"{trial.columns}x{trial.rows}", str(len(trial.images)), *errors, kept))
    click.echo(table(rows))
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
    out: Annotated[Path, Option(path="written", suffix=".png")] = Path("heading.png"),
) -> None:
    """Identify the yaw response of a recorded flight and choose gains of the heading loop.

    RECORD is a flight that turned under yaw-rate commands, such as one of survey_and_land.

    Options:
        out: The PNG file for the plot.
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
