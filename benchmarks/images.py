"""Make the images of README and docs.

    python -m benchmarks.images view flight.rrd --at 24.5 --out view.png
    python -m benchmarks.images film out/mission.mp4 --out docs/images/mission.webp

`view` takes a screenshot of a Rerun file without a display (`uav-bt view flight.mcap
--save flight.rrd`); it needs Vulkan, in software too: Debian's `mesa-vulkan-drivers` and
`libvulkan1`. `film` makes a short animation of a film for a page.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path

from rerun.experimental import ViewerClient

from benchmarks.animation import images_of, write_animation
from uav_bt.display.rerun.setting import TIMELINE
from uav_bt.display.rerun.sinks import viewer_command

PORT = 9911
TIMEOUT_S = 30.0
SETTLE_S = 6.0  # reading the file and drawing in software
_SHOWN_MS = 150  # of one image of an animation


def view(file: Path, at_s: float, size: str, out: Path) -> None:
    """Show a Rerun file off screen, go to a time, and take a screenshot."""
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
    images = images_of(file, every_s, width_px)
    write_animation(images, _SHOWN_MS, out)
    print(f"{out}: {len(images)} images, {out.stat().st_size} bytes")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="what", required=True)
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
    if given.what == "film":
        animate(given.file, given.every, given.width, given.out)
    else:
        view(given.file, given.at, given.size, given.out)


if __name__ == "__main__":
    main()
