"""Projects of tree files in the style of public ones: findings of each file.

Each folder of `tests/data/tree_projects` has a `project.yaml`: `palette`, the file with the models,
and `warned`, the files with warnings, each with words of them.
"""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from uav_bt.tree import NodeRegistry
from uav_bt.tree.loading.findings import errors_of
from uav_bt.tree.loading.loader import check_file
from uav_bt.tree.loading.lookup import Library, Lookup, files_in
from uav_bt.tree.loading.palette import read_palette, with_palette

PROJECTS = Path(__file__).parents[2] / "data" / "tree_projects"
FILES = [
    pytest.param(project.parent, path, id=f"{project.parent.name}/{path.name}")
    for project in sorted(PROJECTS.glob("*/project.yaml"))
    for path in files_in(project.parent)
]


@pytest.mark.parametrize(("project", "path"), FILES)
def test_findings_of_a_file(project: Path, path: Path) -> None:
    asked = yaml.safe_load((project / "project.yaml").read_text(encoding="utf-8"))
    known = with_palette(NodeRegistry(), read_palette(project / asked["palette"]))
    found = check_file(path, known, lookup=Lookup(Library(sorted(project.rglob("*.xml")))))
    words = asked["warned"].get(str(path.relative_to(project)), [])
    assert not errors_of(found)
    assert bool(found) == bool(words), found
    for each in words:
        assert each in "\n".join(map(str, found))
