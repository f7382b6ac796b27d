"""Write the generated parts of `docs/missions/`: drawing, film and figures of a flight.

python -m benchmarks.mission_pages inventory            # fly it, cut the film, write the parts
python -m benchmarks.mission_pages inventory --flown    # of the flight in runs/missions
python -m benchmarks.mission_pages --drawings           # the drawings of all pages, no flight

Without `--flown` the mission flies first; its folder and its film must not exist yet.
"""

from __future__ import annotations

import argparse
import json
import shlex
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.animation import film_seconds, images_of, write_animation_within
from benchmarks.page_parts import (
    IMAGES,
    PAGES,
    ROOT,
    Origin,
    drawing_files,
    flight,
    page_names,
    with_part,
    write,
)
from uav_bt.app.provenance import commit
from uav_bt.errors import FileError, UavBtError
from uav_bt.files import reading
from uav_bt.types.arrays import Image

RUNS: Final = Path("runs/missions")  # relative to the repository, as in the commands of the pages
SCENE: Final = "train-a"
SEED: Final = 0

_SHOWN_IMAGES: Final = 90
_SHOWN_MS: Final = 150
_WIDTH_PX: Final = 400
_LIMIT_BYTES: Final = 600_000
_MAP_ROWS: Final = 404  # of the 720 of a film, at the top of its right half


def fly(name: str) -> None:
    """Fly a mission as a user does; keep its outputs and their origin in `RUNS`.

    Args:
        name: a shipped mission.

    Raises:
        SystemExit: the flight was refused, or the mission did not succeed.
    """
    command = [
        *("uav-bt", "fly", name, "--scene", SCENE, "--seed", str(SEED)),
        *("--image-size", "320x180"),
        *("--out", f"{RUNS / name}", "--video", f"{RUNS / name}.mp4"),
    ]
    (ROOT / RUNS).mkdir(parents=True, exist_ok=True)
    source = commit(ROOT) or "unknown"
    head, plus, changes = source.partition("+")
    today = datetime.now(UTC).date()
    origin = Origin(
        command=shlex.join(command),
        commit=f"{head[:7]}{plus}{changes}",
        day=f"{today.day} {today:%B %Y}",
    )
    done = subprocess.run(  # noqa: S603 - our own program
        [sys.executable, "-m", "uav_bt", *command[1:]], cwd=ROOT, check=False
    )
    if done.returncode:
        print(f"{name}: the flight ended with {done.returncode}; its page is unchanged")
        sys.exit(done.returncode)
    origin_file(name).write_text(json.dumps(origin.to_json(), indent=2) + "\n", encoding="utf-8")


def origin_file(name: str) -> Path:
    """Return the file that keeps command, commit and day of a mission's flight."""
    return ROOT / RUNS / f"{name}.origin.json"


def camera_and_map(image: Image) -> Image:
    """Return the camera's pane of a film's image above the map's pane.

    Args:
        image: 720x1280x3, uint8, BGR.

    Returns:
        764x640x3, uint8, BGR.
    """
    high, half = image.shape[0] // 2, image.shape[1] // 2
    return np.vstack([image[:high, :half], image[:_MAP_ROWS, half:]])


def write_flight(name: str) -> None:
    """Cut the film of the flight in `RUNS`, and write film and figures to the mission's page.

    Args:
        name: a shipped mission.

    Raises:
        FileError: there is no such flight, or the page has no such part.
        ValueError: the film is too large.
    """
    for file in (origin_file(name), ROOT / RUNS / f"{name}.mp4"):
        if not file.is_file():
            raise FileError(file, "no such file: fly the mission first, without --flown")
    origin_text, report_text = origin_file(name), ROOT / RUNS / name / "report.json"
    with reading(report_text):
        report = json.loads(report_text.read_text(encoding="utf-8"))
        origin = Origin(**json.loads(origin_text.read_text(encoding="utf-8")))
    film, out = ROOT / RUNS / f"{name}.mp4", IMAGES / f"{name}.webp"
    film_s = film_seconds(film)
    images = images_of(film, film_s / _SHOWN_IMAGES, _WIDTH_PX, camera_and_map)
    write_animation_within(images, _SHOWN_MS, out, _LIMIT_BYTES)
    speed = film_s / (len(images) * _SHOWN_MS / 1000)
    page = PAGES / f"{name}.md"
    write({page: with_part(page, "flight", flight(report, origin, name, speed))})
    print(f"{out.relative_to(ROOT)}: {len(images)} images, {out.stat().st_size} bytes")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="missions with a page")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--drawings", action="store_true", help="write the drawings only")
    which.add_argument("--flown", action="store_true", help=f"do not fly: flights are in {RUNS}")
    given = parser.parse_args()
    known = page_names()
    if unknown := [name for name in given.names if name not in known]:
        parser.error(f"no page of {', '.join(unknown)}; there are pages of {', '.join(known)}")
    if not given.names and not given.drawings:
        parser.error(f"expected the missions to fly: {', '.join(known)}; or --drawings")
    IMAGES.mkdir(parents=True, exist_ok=True)
    try:
        for name in given.names or known:
            if not given.drawings:
                if not given.flown:
                    fly(name)
                write_flight(name)
            write(drawing_files(name))
    except (UavBtError, ValueError) as error:
        print(error, file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
