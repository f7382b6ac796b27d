"""The tree files of `tests/data/tree_projects` and their expected results.

Each folder is a project of tree files in the style of public ones, with a `project.yaml`:

    palette: palette.xml             # the file with the models of the leaves
    warned: {game.xml: [...]}        # files with warnings, and words of each
    runs:                            # dry runs, by a label
      low battery:
        file: rounds.xml
        tree: Rounds
        ticks: 5                     # at most
        script: {default: S, ...}    # as `uav-bt simulate` reads it
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import yaml

PROJECTS: Final = Path(__file__).parent / "data" / "tree_projects"


@dataclass(frozen=True, kw_only=True)
class Run:
    """A dry run of one of a project's trees."""

    label: str
    file: Path
    tree_id: str
    ticks: int
    script: Mapping[str, Any]
    palette: Path
    files: tuple[Path, ...]  # files of the project that contain trees


def projects() -> dict[str, dict[str, Any]]:
    """Return the expectations of each project, by the folder's name."""
    return {
        path.parent.name: yaml.safe_load(path.read_text(encoding="utf-8"))
        for path in sorted(PROJECTS.glob("*/project.yaml"))
    }


def tree_files(project: str) -> tuple[Path, ...]:
    """Return the files of a project that contain trees."""
    return tuple(sorted((PROJECTS / project).rglob("*.xml")))


def read_runs() -> list[Run]:
    """Return the runs of all projects."""
    return [
        Run(
            label=f"{name}: {label}",
            file=PROJECTS / name / run["file"],
            tree_id=run["tree"],
            ticks=run["ticks"],
            script=run["script"],
            palette=PROJECTS / name / asked["palette"],
            files=tree_files(name),
        )
        for name, asked in projects().items()
        for label, run in asked["runs"].items()
    ]
