"""Take a picture of a view without a display.

    uav-bt fly explore_and_land_depth --scene train-b --seed 5 --record flight.mcap
    uav-bt view flight.mcap --save flight.rrd
    python benchmarks/view_picture.py flight.rrd --at 24.5 --out view.png

Needs Vulkan, in software too: `mesa-vulkan-drivers` and `libvulkan1` of Debian.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path

from rerun.experimental import ViewerClient

from uav_bt.display.rerun.entities import TIMELINE
from uav_bt.display.rerun.sinks import viewer_command

PORT = 9911
PATIENCE_S = 30.0
SETTLE_S = 6.0  # reading the file and drawing in software


def connect(deadline_s: float) -> ViewerClient:
    """Return a connection to the viewer as soon as it answers."""
    while True:
        try:
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{PORT}/proxy")
            client.get_state()
        except Exception:
            if time.monotonic() > deadline_s:
                raise
            time.sleep(0.5)
        else:
            return client


def main() -> None:
    """Show the file off screen, go to a time, and take the picture."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("view", type=Path)
    parser.add_argument("--at", type=float, default=0.0, help="seconds of the flight")
    parser.add_argument("--size", default="1600x900")
    parser.add_argument("--out", type=Path, default=Path("view.png"))
    given = parser.parse_args()
    if not given.view.is_file():
        sys.exit(f"{given.view}: there is no such file")
    command = viewer_command(PORT, None)[:5]
    viewer = subprocess.Popen(  # noqa: S603 - Rerun's own program
        [*command, str(given.view), "--headless", "--window-size", given.size],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        client = connect(time.monotonic() + PATIENCE_S)
        time.sleep(SETTLE_S)
        client.set_time(TIMELINE, duration=given.at, play_state="paused")
        time.sleep(SETTLE_S)
        client.save_screenshot(str(given.out.resolve()))
    finally:
        viewer.terminate()
        viewer.wait()
    print(f"{given.out}: {given.out.stat().st_size} bytes")


if __name__ == "__main__":
    main()
