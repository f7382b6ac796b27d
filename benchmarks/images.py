"""Make the images of README and docs.

    python benchmarks/images.py flight --scene val-b --seed 1 --at 6
    python benchmarks/images.py view flight.rrd --at 24.5 --out view.png
    python benchmarks/images.py film out/mission.mp4 --out docs/images/mission.webp

`flight` flies a mission and writes the lab, a frame, its class map and the flown path to
docs/images. `view` takes a screenshot of a Rerun file without a display (`uav-bt view flight.mcap
--save flight.rrd`); it needs Vulkan, in software too: Debian's `mesa-vulkan-drivers` and
`libvulkan1`. `film` makes a short animation of a film for a page.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views
from uav_bt import app
from uav_bt.app import film
from uav_bt.board import CLASS_MAP
from uav_bt.classes import colourise
from uav_bt.display.flown_path import FlownPath
from uav_bt.display.lab_map import LabMap, draw_path_map
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.protocols import Drone

PORT = 9911
TIMEOUT_S = 30.0
SETTLE_S = 6.0  # reading the file and drawing in software
_SHOWN_MS = 150  # of one image of an animation


class Album:
    """Keeps a frame with its class map at one moment, and the whole path.

    Args:
        at_s: when the frame is taken.
    """

    def __init__(self, at_s: float) -> None:
        self._at_s = at_s
        self.lab: LabMap | None = None
        self.path = FlownPath()
        self.frame: NDArray[np.uint8] | None = None
        self.mask: NDArray[np.uint8] | None = None

    def __call__(self, flight: app.Flight[Drone]) -> Sequence[TickListener]:
        """Begin with a flight."""
        self.lab, self._board = film.lab_map_of(flight.drone), flight.context.board
        return [self]

    def on_tick(self, record: TickRecord) -> None:
        """Take note of a tick."""
        self.path.add(record)
        class_map = self._board.read(CLASS_MAP).value
        frame = record.observation.frame
        if self.frame is None and record.time_s >= self._at_s and class_map and frame:
            self.frame, self.mask = frame.image, colourise(class_map.ids)


def save(path: Path, rgb: NDArray[np.uint8]) -> None:
    """Write a PNG."""
    cv2.imwrite(str(path), cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))
    print(path)


def flight(scene: str, seed: int, at_s: float, folder: Path) -> None:
    """Draw the lab, fly, and draw a frame, its class map and the path."""
    folder.mkdir(parents=True, exist_ok=True)
    corner = CameraPose(
        x_m=-3.4, y_m=-2.9, z_m=3.0, yaw_rad=math.radians(40), pitch_rad=math.radians(-33)
    )
    lab = next(render_views(load_scene(scene), [corner], size_px=(1280, 720)))
    save(folder / "lab.png", lab.image)
    album = Album(at_s)
    options = app.FlightOptions(scene=scene, seed=seed)
    report = app.fly("explore_and_land_segmentation", options, listeners=[album])
    if album.frame is not None and album.mask is not None:
        save(folder / "frame.png", album.frame)
        size = album.frame.shape[1::-1]
        save(folder / "mask.png", cv2.resize(album.mask, size, interpolation=cv2.INTER_NEAREST))
    title = f"{scene}, seed {seed}: {report.outcome}, {report.total_distance_m:.1f} m"
    path = draw_path_map(album.lab, album.path.points, size_px=(960, 780), title=title)
    save(folder / "path.png", path)


def view(file: Path, at_s: float, size: str, out: Path) -> None:
    """Show a Rerun file off screen, go to a time, and take a screenshot."""
    from rerun.experimental import ViewerClient  # noqa: PLC0415  (an extra that `flight` needs not)

    from uav_bt.display.rerun.setting import TIMELINE  # noqa: PLC0415  (as above)
    from uav_bt.display.rerun.sinks import viewer_command  # noqa: PLC0415  (as above)

    if not file.is_file():
        sys.exit(f"{file}: there is no such file")
    viewer = subprocess.Popen(  # noqa: S603 - Rerun's own program
        [*viewer_command(PORT, None)[:5], str(file), "--headless", "--window-size", size],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    deadline_s = time.monotonic() + TIMEOUT_S
    try:
        while True:
            try:
                client = ViewerClient.connect(f"rerun+http://127.0.0.1:{PORT}/proxy")
                client.get_state()
            except Exception:
                if time.monotonic() > deadline_s:
                    raise
                time.sleep(0.5)
            else:
                break
        time.sleep(SETTLE_S)
        client.set_time(TIMELINE, duration=at_s, play_state="paused")
        time.sleep(SETTLE_S)
        client.save_screenshot(str(out.resolve()))
    finally:
        viewer.terminate()
        viewer.wait()
    print(f"{out}: {out.stat().st_size} bytes")


def animate(file: Path, every_s: float, width_px: int, out: Path) -> None:
    """Make an animated WebP of a film: one image for each step of time, fast forward."""
    images = []
    with av.open(str(file)) as container:
        for one in container.decode(video=0):
            if (one.time or 0.0) >= every_s * len(images):
                height_px = round(one.height * width_px / one.width)
                images.append(one.to_ndarray(width=width_px, height=height_px, format="bgr24"))
    animation = cv2.Animation()
    animation.frames = images
    animation.durations = [_SHOWN_MS] * len(images)
    cv2.imwriteanimation(str(out), animation, [cv2.IMWRITE_WEBP_QUALITY, 40])
    print(f"{out}: {len(images)} images, {out.stat().st_size} bytes")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="what", required=True)
    flown = commands.add_parser("flight")
    flown.add_argument("--scene", default="val-a")
    flown.add_argument("--seed", type=int, default=1)
    flown.add_argument("--at", type=float, default=30.0, help="of the frame, seconds")
    flown.add_argument("--out", type=Path, default=Path("docs/images"))
    shown = commands.add_parser("view")
    shown.add_argument("file", type=Path)
    shown.add_argument("--at", type=float, default=0.0, help="seconds of the flight")
    shown.add_argument("--size", default="1600x900")
    shown.add_argument("--out", type=Path, default=Path("view.png"))
    cut = commands.add_parser("film")
    cut.add_argument("file", type=Path)
    cut.add_argument("--every", type=float, default=2.0, help="seconds of the film between images")
    cut.add_argument("--width", type=int, default=800, help="of the animation, pixels")
    cut.add_argument("--out", type=Path, default=Path("mission.webp"))
    given = parser.parse_args()
    if given.what == "flight":
        flight(given.scene, given.seed, given.at, given.out)
    elif given.what == "film":
        animate(given.file, given.every, given.width, given.out)
    else:
        view(given.file, given.at, given.size, given.out)


if __name__ == "__main__":
    main()
