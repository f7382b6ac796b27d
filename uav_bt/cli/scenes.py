"""`uav-bt scenes`: the labs that ship with the twin."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from uav_bt.cli.options import output_option
from uav_bt.files import writing

if TYPE_CHECKING:
    from sim_bridge.twin.scene import Scene

__all__ = ["scenes"]

_FLIGHT_HEIGHT_M = 1.5  # of the shipped missions: only boxes that reach it stand in the way


@click.command()
@click.option("--show", "shown", metavar="SCENE", help="A scene, by name or file, to draw.")
@output_option("--out", "The PNG file for the map; SCENE.png if not given.")
def scenes(*, shown: str | None, out: Path | None) -> None:
    """List the scenes that ship with uav-bt, or draw the map of one."""
    from sim_bridge.twin.scene_file import load_scene, scene_names  # noqa: PLC0415 - late, for --help

    if shown is None:
        if out is not None:
            raise click.UsageError("--out needs --show SCENE")
        for name in scene_names():
            click.echo(f"{name:<10}{_line(load_scene(name))}")
        return
    scene = load_scene(shown)
    path = Path(f"{scene.name}.png") if out is None else out
    _draw(scene, path)
    click.echo(f"{scene.name}: {_line(scene)}\nmap: {path}")


def _line(scene: Scene) -> str:
    tall = sum(box.size_m[2] >= _FLIGHT_HEIGHT_M for box in scene.boxes)
    heights = [box.size_m[2] for box in scene.boxes]
    span = f", {min(heights):.2f} to {max(heights):.2f} m high" if heights else ""
    x_m, y_m = scene.helipad.position_m
    start = scene.take_off
    if start.random:
        place = "a random place"
    elif start.position_m is not None:
        place = f"({start.position_m[0]:g}, {start.position_m[1]:g})"
    else:
        place = "the helipad"
    return (
        f"{len(scene.boxes)} boxes{span} ({tall} reach {_FLIGHT_HEIGHT_M} m), "
        f"helipad at ({x_m:g}, {y_m:g}), take-off from {place}"
    )


def _draw(scene: Scene, path: Path) -> None:
    import cv2  # noqa: PLC0415 - only drawing needs these

    from uav_bt.app.film import map_of_scene  # noqa: PLC0415
    from uav_bt.display.lab_map import draw_path_map  # noqa: PLC0415

    picture = draw_path_map(map_of_scene(scene), [], title=scene.name)
    _, png = cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    with writing(path):
        path.write_bytes(png.tobytes())
