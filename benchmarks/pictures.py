"""Draw the pictures of README and docs: the lab, a frame, its class map, a flown path.

python benchmarks/pictures.py            # writes docs/images/*.png
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views
from uav_bt import app
from uav_bt.app import film
from uav_bt.board import CLASS_MAP
from uav_bt.board.context import MissionContext
from uav_bt.classes import colourise
from uav_bt.display.flown_path import FlownPath
from uav_bt.display.lab_map import LabMap, draw_path_map
from uav_bt.mission.runner import TickListener, TickRecord
from uav_bt.protocols import Drone


class _Album:
    """Keeps a frame with its class map at one moment, and the whole path."""

    def __init__(self, drone: Drone, context: MissionContext, at_s: float) -> None:
        self._context = context
        self._at_s = at_s
        self.lab: LabMap | None = film.lab_map_of(drone)
        self.path = FlownPath()
        self.frame: np.ndarray | None = None
        self.mask: np.ndarray | None = None

    def on_tick(self, record: TickRecord) -> None:
        """Take note of a tick."""
        self.path.add(record)
        class_map = self._context.board.read(CLASS_MAP).value
        frame = record.observation.frame
        if self.frame is None and record.time_s >= self._at_s and class_map and frame:
            self.frame, self.mask = frame.image, colourise(class_map.ids)


def _save(path: Path, rgb: np.ndarray) -> None:
    cv2.imwrite(str(path), cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))
    print(path)


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scene", default="val-a")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--at", type=float, default=30.0, help="of the frame, seconds")
    parser.add_argument("--out", type=Path, default=Path("docs/images"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)

    corner = CameraPose(
        x_m=-3.4, y_m=-2.9, z_m=3.0, yaw_rad=math.radians(40), pitch_rad=math.radians(-33)
    )
    lab = next(render_views(load_scene(args.scene), [corner], size_px=(1280, 720)))
    _save(args.out / "lab.png", lab.image)

    albums: list[_Album] = []

    def listeners(drone: Drone, context: MissionContext) -> Sequence[TickListener]:
        albums.append(_Album(drone, context, args.at))
        return albums

    report = app.fly(
        "explore_and_land_segmentation",
        app.FlightOptions(scene=args.scene, seed=args.seed),
        listeners=listeners,
    )
    album = albums[0]
    if album.frame is not None and album.mask is not None:
        _save(args.out / "frame.png", album.frame)
        size = album.frame.shape[1::-1]
        _save(args.out / "mask.png", cv2.resize(album.mask, size, interpolation=cv2.INTER_NEAREST))
    title = f"{args.scene}, seed {args.seed}: {report.outcome}, {report.total_distance_m:.1f} m"
    picture = draw_path_map(album.lab, album.path.points, size_px=(960, 780), title=title)
    _save(args.out / "path.png", picture)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
