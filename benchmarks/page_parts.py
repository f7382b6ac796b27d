"""Generated parts of the pages of missions: the drawing of the tree, film and figures of a flight.

A part stands between the lines `<!-- NAME -->` and `<!-- end -->` of `docs/missions/MISSION.md`;
the rest of the page is written by hand.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

from uav_bt.app.rules import rules_of
from uav_bt.errors import FileError
from uav_bt.files import reading, write_whole
from uav_bt.tree import MissionTree, NodeRegistry, load_tree
from uav_bt.tree.render import ascii_art, render
from uav_bt.tree.render.sketch import Box, sketch
from uav_bt.tree.shipped import resolve_tree
from uav_bt.types.mission_rules import LandOn

ROOT: Final = Path(__file__).parents[1]
PAGES: Final = ROOT / "docs" / "missions"
IMAGES: Final = ROOT / "docs" / "images" / "missions"

_END: Final = "<!-- end -->"
_TREE_ID: Final = re.compile(r'<BehaviorTree ID="(\w+)"')


@dataclass(frozen=True, kw_only=True)
class Origin:
    """The origin of a flight's figures."""

    command: str
    commit: str
    day: str

    def to_json(self) -> dict[str, str]:
        """Return plain JSON values."""
        return asdict(self)


def page_names() -> list[str]:
    """Return the missions that have a page."""
    return sorted(page.stem for page in PAGES.glob("*.md"))


def load(name: str) -> MissionTree:
    """Return the tree of a shipped mission."""
    return load_tree(resolve_tree(name), NodeRegistry.installed())


def drawing_files(name: str) -> dict[Path, str]:
    """Return page and whole drawing of a mission, by their files, as they are by today's trees.

    Args:
        name: a shipped mission.

    Raises:
        FileError: the mission has no page, or the page has no such part.
    """
    tree = load(name)
    page = PAGES / f"{name}.md"
    return {
        IMAGES / f"{name}.svg": render(tree, "svg"),
        page: with_part(page, "drawing", drawing(tree, name)),
    }


def drawing(tree: MissionTree, name: str) -> str:
    """Return the part `drawing`: the mission's own trees, each shared tree as one line.

    Args:
        tree: the mission's tree.
        name: the mission.
    """
    own = set(_TREE_ID.findall(resolve_tree(name).read_text(encoding="utf-8")))
    lines = ascii_art(_folded(sketch(tree.root), own), tree.name)
    return (
        f"```text\n{lines}```\n\n"
        "A `SubTree` without children is a shared tree of [trees/lib](../../trees/lib); "
        f"the [whole drawing](../images/missions/{name}.svg) has all nodes.\n"
    )


def _folded(box: Box, own: set[str]) -> Box:
    """Return a box without the nodes below the subtrees of other files."""
    word, _, tree_id = box.tag.partition(" ")
    if word == "SubTree" and tree_id not in own:
        return replace(box, children=())
    return replace(box, children=tuple(_folded(child, own) for child in box.children))


def flight(report: dict[str, Any], origin: Origin, name: str, speed: float) -> str:
    """Return the part `flight`: the film, its flight's figures, and where they come from.

    Args:
        report: the flight's report (`FlightReport.to_json`).
        origin: command, commit and day of the flight.
        name: the mission.
        speed: flight time by time of the film.
    """
    figures = dict(_figures(report, lands_on=rules_of(load(name)).land_on))
    rows = (figures.keys(), ["---"] * len(figures), figures.values())
    table = "".join(f"| {' | '.join(row)} |\n" for row in rows)
    return (
        f"![Camera and map of a flight of {name}](../images/missions/{name}.webp)\n\n"
        f"Camera above; below it the map that the drone makes, true outlines in blue. The film is "
        f"{speed:.1f} times as fast as the flight.\n\n"
        f"{table}\n"
        f"Commit `{origin.commit}`, {origin.day}, one flight in the twin, "
        f"profile `{report['profile']}`:\n"
        f"`{origin.command}`.\n"
        "Success rates: [results](../results.md#missions-of-places-and-objects). Other missions: "
        "[missions](../missions.md).\n"
    )


def _figures(report: dict[str, Any], *, lands_on: LandOn | None) -> Iterator[tuple[str, str]]:
    yield "scene, seed", f"`{report['scene']}`, {report['seed']}"
    yield "outcome", f"{report['outcome']}: {report['reason']}"
    yield "duration", f"{report['duration_s']:.1f} s"
    yield "distance", f"{report['total_distance_m']:.1f} m"
    if report["photos"]:
        yield "photographs", str(len(report["photos"]))
    found, false = report["objects_found"], report["false_objects"]
    yield "objects found", f"{found} of {report['objects_total']}, {false} false"
    yield "least clearance", f"{report['min_clearance_m']:.2f} m"
    if lands_on in (None, LandOn.MARK):
        yield "landing error", f"{report['landing_error_m']:.3f} m"


def with_part(page: Path, part: str, text: str) -> str:
    """Return the text of a page with another text in one of its generated parts.

    Args:
        page: the page's file.
        part: name of the part.
        text: its new text, complete lines.

    Raises:
        FileError: the page cannot be read, or does not have the part once.
    """
    with reading(page):
        old = page.read_text(encoding="utf-8")
    begin = f"<!-- {part} -->\n"
    before, found, rest = old.partition(begin)
    _, ended, after = rest.partition(_END)
    if not found or not ended or begin in after:
        raise FileError(
            page,
            f"expected one line `{begin.strip()}` with a line `{_END}` below it: "
            "the generated part stands between them",
        )
    return f"{before}{begin}{text}{_END}{after}"


def write(files: dict[Path, str]) -> None:
    """Write texts to their files.

    Raises:
        FileError: a file cannot be written.
    """
    for path, text in files.items():
        write_whole(path, text)
