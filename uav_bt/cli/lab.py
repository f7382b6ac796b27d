"""`uav-bt lab new`, `schema` and `scenes`: a lab file to begin with, scenes of the twin."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Final

import click
import cv2

from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene, scene_names
from uav_bt.app.film import map_of_scene
from uav_bt.app.flight import check as check_tree
from uav_bt.app.place import drawn_places
from uav_bt.cli.declare import command
from uav_bt.cli.shared import print_or_write
from uav_bt.display.lab_map import draw_lab_with_axes
from uav_bt.files import writing
from uav_bt.lab.lab_file import lab_schema
from uav_bt.lab.shipped import write_lab
from uav_bt.option import Option

_FLIGHT_HEIGHT_M: Final = 1.5  # of the shipped missions: only boxes that reach it are in their way


@command()
def new(
    name: str,
    *,
    folder: Annotated[
        Path, Option("Folder of your labs; it is made if it is absent.", "--in DIR")
    ] = Path("labs"),
) -> None:
    """Write a commented lab file for a place of yours.

    NAME is the place, such as hall: its folder is labs/hall, and --lab hall finds it. A folder that
    exists is not changed.
    """
    path = write_lab(name, folder)
    click.echo(f"written: {path} (edit it, then try: uav-bt check land_only --lab {path.parent})")


@command()
def schema(
    *,
    out: Annotated[
        Path | None,
        Option(
            "Write the schema there; it is printed if not given.", path="written", suffix=".json"
        ),
    ] = None,
) -> None:
    """Write a JSON schema of lab files.

    YAML editors complete, explain and check lab files with it. They find it by this line at the
    head of a lab file:

    \b
      # yaml-language-server: $schema=lab.schema.json
    """  # noqa: D301  (click needs the backspace)
    print_or_write(lab_schema(), out)


@command()
def scenes(
    *,
    shown: Annotated[
        str | None, Option("A scene, by name or file, to draw.", "--show SCENE")
    ] = None,
    tree: Annotated[str | None, Option("A mission whose places are drawn, too.", "TREE")] = None,
    out: Annotated[
        Path | None,
        Option("The PNG file for the map; SCENE.png if not given.", path="written", suffix=".png"),
    ] = None,
) -> None:
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
