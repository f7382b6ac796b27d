"""Files in the style of public projects: their findings equal `verdicts.yaml`."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from uav_bt.tree import NodeRegistry
from uav_bt.tree.loading.findings import errors_of
from uav_bt.tree.loading.loader import check_file
from uav_bt.tree.loading.lookup import Library, Lookup, files_in
from uav_bt.tree.loading.models import with_palette

FILES = Path(__file__).parents[2] / "data" / "tree_files"
VERDICTS = yaml.safe_load((FILES / "verdicts.yaml").read_text(encoding="utf-8"))
REGISTRY = with_palette(NodeRegistry(), FILES / "palette.xml")
WORKSPACE = Lookup(Library(path for path in files_in(FILES / "workspace") if path.suffix == ".xml"))


@pytest.mark.parametrize("name", VERDICTS)
def test_verdict(name: str) -> None:
    verdict = VERDICTS[name]
    found = check_file(FILES / name, REGISTRY, lookup=WORKSPACE)
    got = "refused" if errors_of(found) else "warned" if found else "taken"
    assert got == verdict["here"], found
    assert verdict.get("words", "") in "\n".join(map(str, found))
    # We accept exactly the files that the engine accepts, except for texts in double quotes, which
    # all releases before 4.9 accept.
    if name != "double_quotes.xml":
        assert (got == "refused") == (verdict["engine"] != "taken")


def test_every_file_has_a_verdict() -> None:
    assert {str(path.relative_to(FILES)) for path in files_in(FILES)} == {*VERDICTS, "palette.xml"}


# --- projects: each has a project.yaml, with its palette and words of its warnings ----------------

PROJECTS = Path(__file__).parents[2] / "data" / "tree_projects"
PROJECT_FILES = [
    pytest.param(project.parent, path, id=f"{project.parent.name}/{path.name}")
    for project in sorted(PROJECTS.glob("*/project.yaml"))
    for path in files_in(project.parent)
]


@pytest.mark.parametrize(("project", "path"), PROJECT_FILES)
def test_findings_of_a_file(project: Path, path: Path) -> None:
    asked = yaml.safe_load((project / "project.yaml").read_text(encoding="utf-8"))
    known = with_palette(NodeRegistry(), project / asked["palette"])
    found = check_file(path, known, lookup=Lookup(Library(sorted(project.rglob("*.xml")))))
    words = asked["warned"].get(str(path.relative_to(project)), [])
    assert not errors_of(found)
    assert bool(found) == bool(words), found
    for each in words:
        assert each in "\n".join(map(str, found))
