"""Write what is generated for `docs/missions/`: drawing, film and figures of a flight.

    python -m benchmarks.mission_pages inventory     # fly it and write all parts
    python -m benchmarks.mission_pages --drawings    # the drawings of all missions

The figures stand between the lines `<!-- flight -->` and `<!-- end -->`; the rest of a page is
written by hand. `runs/missions` keeps the flight, and must not have one of this mission yet.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import av
import cv2
import numpy as np

from uav_bt.app.place import rules_of
from uav_bt.app.provenance import commit
from uav_bt.tree import MissionTree, NodeRegistry, load_tree
from uav_bt.tree.describe import render
from uav_bt.tree.shipped import resolve_tree
from uav_bt.types.place import LandOn

ROOT: Final = Path(__file__).parents[1]
PAGES: Final = ROOT / "docs" / "missions"
NAMES: Final = sorted(page.stem for page in PAGES.glob("*.md"))  # of the missions with a page
IMAGES: Final = ROOT / "docs" / "images" / "missions"
RUNS: Final = Path("runs/missions")  # relative to the repository, as in the commands of the pages
END: Final = "<!-- end -->"
SHOWN_IMAGES: Final = 90
SHOWN_MS: Final = 150  # each
SHOWN_PX: Final = (400, 478)
LIMIT_BYTES: Final = 600_000


def with_part(page: Path, part: str, text: str) -> str:
    """Return the text of a page with another text in one of its generated parts."""
    before, found, rest = page.read_text(encoding="utf-8").partition(f"<!-- {part} -->\n")
    _, ended, after = rest.partition(END)
    if not found or not ended:
        raise SystemExit(f"{page}: expected a line `<!-- {part} -->`, and `{END}` below it")
    return f"{before}{found}{text}{END}{after}"


def load(name: str) -> MissionTree:
    """Return the tree of a shipped mission."""
    return load_tree(resolve_tree(name), NodeRegistry.installed())


def drawing(name: str) -> str:
    """Return the drawing of a mission, as it is by today's trees."""
    tree = load(name)
    return render(tree.root, tree.name, "svg")


def flight_part(report: dict[str, Any], name: str, *, speed: float, source: str) -> str:
    """Return the part `flight`: the film, its flight's figures, and where they come from."""
    figures = {
        "scene, seed": "`{scene}`, {seed}",
        "outcome": "{outcome}: {reason}",
        "duration": "{duration_s:.1f} s",
        "distance": "{total_distance_m:.1f} m",
        **({"photographs": str(len(report["photos"]))} if report["photos"] else {}),
        "objects found": "{objects_found} of {objects_total}, {false_objects} false",
        "least clearance": "{min_clearance_m:.2f} m",
    }
    if rules_of(load(name)).land_on in (None, LandOn.MARK):
        figures["landing error"] = "{landing_error_m:.3f} m"
    texts = [text.format(**report) for text in figures.values()]
    rows = (figures, ["---"] * len(figures), texts)
    table = "".join(f"| {' | '.join(row)} |\n" for row in rows)
    return (
        f"![Camera and map of a flight of {name}](../images/missions/{name}.webp)\n\n"
        "Camera above; below it the map that the drone makes, true outlines in blue. The film is "
        f"{speed:.1f} times as fast as the flight.\n\n{table}\n{source}"
        "Success rates: [results](../results.md#missions-of-places-and-objects). Other missions: "
        "[missions](../missions.md).\n"
    )


def animate(film: Path, out: Path) -> float:
    """Write camera and map of a film as an animated WebP; return how many times as fast it is."""
    images: list[Any] = []
    with av.open(str(film)) as container:
        film_s = float((container.duration or 0) / av.time_base)
        for one in container.decode(video=0):
            if (one.time or 0.0) >= film_s / SHOWN_IMAGES * len(images):
                image = one.to_ndarray(format="bgr24")
                panes = np.vstack([image[:360, :640], image[:404, 640:]])  # of 720x1280
                images.append(cv2.resize(panes, SHOWN_PX, interpolation=cv2.INTER_AREA))
    animation = cv2.Animation()
    animation.frames, animation.durations = images, [SHOWN_MS] * len(images)
    for quality in (60, 50, 40, 30, 20, 10):
        cv2.imwriteanimation(str(out), animation, [cv2.IMWRITE_WEBP_QUALITY, quality])
        if out.stat().st_size <= LIMIT_BYTES:
            break
    return film_s / (len(images) * SHOWN_MS / 1000)


def fly(name: str) -> None:
    """Fly a mission as a user does, and write film and figures to its page."""
    video = RUNS / f"{name}.mp4"
    command = (
        f"uav-bt fly {name} --scene train-a --seed 0 --image-size 320x180 --out {RUNS / name} "
        f"--video {video}"
    )
    (ROOT / RUNS).mkdir(parents=True, exist_ok=True)
    head, plus, changes = (commit(ROOT) or "unknown").partition("+")
    words = [sys.executable, "-m", "uav_bt", *command.split()[1:]]
    subprocess.run(words, cwd=ROOT, check=True)  # noqa: S603 - our own program
    report = json.loads((ROOT / RUNS / name / "report.json").read_text(encoding="utf-8"))
    speed = animate(ROOT / video, IMAGES / f"{name}.webp")
    today = datetime.now(UTC).date()
    source = (
        f"Commit `{head[:7]}{plus}{changes}`, {today.day} {today:%B %Y}, one flight in the twin, "
        f"profile `{report['profile']}`:\n`{command}`.\n"
    )
    part = flight_part(report, name, speed=speed, source=source)
    page = PAGES / f"{name}.md"
    page.write_text(with_part(page, "flight", part), encoding="utf-8")


def main() -> None:
    """Write the parts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="missions with a page, to fly")
    parser.add_argument("--drawings", action="store_true", help="write the drawings only")
    given = parser.parse_args()
    for name in NAMES if given.drawings else given.names:
        if not given.drawings:
            fly(name)
        (IMAGES / f"{name}.svg").write_text(drawing(name), encoding="utf-8")


if __name__ == "__main__":
    main()
