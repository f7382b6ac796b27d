"""Projects of tree files in the style of public ones: findings and ticks of each file."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest
import yaml

from tests.engine_ticks import TICKS
from tests.tree_projects import PROJECTS, Run, projects, read_runs, tree_files
from uav_bt.tree import Leaf, Node, NodeRegistry
from uav_bt.tree.dry_run import Simulation, read_script
from uav_bt.tree.loading.findings import errors_of
from uav_bt.tree.loading.loader import check_file
from uav_bt.tree.loading.lookup import Library, Lookup, files_in
from uav_bt.tree.loading.palette import read_palette, with_palette
from uav_bt.tree.observer import NodeEvent, observe
from uav_bt.tree.scripted import ScriptedLeaf

ASKED = projects()
RUNS = read_runs()
ENGINE = yaml.safe_load(TICKS.read_text(encoding="utf-8"))
ANSWERS = {
    NodeEvent.CONTINUES: "RUNNING",
    NodeEvent.SUCCEEDED: "SUCCESS",
    NodeEvent.FAILED: "FAILURE",
}
FILES = [
    pytest.param(project, path, id=f"{project}/{path.name}")
    for project in ASKED
    for path in files_in(PROJECTS / project)
]


class Watch:
    """Collects the answers of scripted leaves that were ticked, not merely skipped or failed."""

    def __init__(self, leaves: Iterable[Leaf]) -> None:
        self.answers: list[str] = []
        self._at_work: set[Node] = set()
        observe([leaf for leaf in leaves if isinstance(leaf, ScriptedLeaf)], self._note)

    def _note(self, node: Node, event: NodeEvent) -> None:
        if event in {NodeEvent.STARTED, NodeEvent.RAN}:
            self._at_work.add(node)
        elif event in ANSWERS and node in self._at_work:
            self._at_work.remove(node)
            self.answers.append(f"{node.name.partition('#')[0]} {ANSWERS[event]}")


def workspace(project: str) -> Lookup:
    return Lookup(Library(tree_files(project)))


def registry(palette: Path) -> NodeRegistry:
    return with_palette(NodeRegistry(), read_palette(palette))


@pytest.mark.parametrize(("project", "path"), FILES)
def test_findings_of_a_file(project: str, path: Path) -> None:
    known = registry(PROJECTS / project / ASKED[project]["palette"])
    found = check_file(path, known, lookup=workspace(project))
    words = ASKED[project]["warned"].get(str(path.relative_to(PROJECTS / project)), [])
    assert not errors_of(found)
    assert bool(found) == bool(words), found
    for each in words:
        assert each in "\n".join(map(str, found))


@pytest.mark.parametrize("run", RUNS, ids=[run.label for run in RUNS])
def test_it_ticks_as_the_engine_does(run: Run, tmp_path: Path) -> None:
    """The ticks equal those of release 4.8.2; see `tests/engine_ticks.py`."""
    script = tmp_path / "answers.yaml"
    script.write_text(yaml.safe_dump(dict(run.script)), encoding="utf-8")
    simulation = Simulation(
        run.file,
        read_script(script),
        registry(run.palette),
        tree_id=run.tree_id,
        lookup=workspace(run.label.partition(":")[0]),
    )
    watch = Watch(simulation.tree.leaves())
    lines = []
    for tick in simulation.run(run.ticks):
        lines.append(", ".join([tick.status.name, *watch.answers]))
        watch.answers.clear()
    assert lines == ENGINE[run.label]


def test_every_run_was_recorded() -> None:
    assert set(ENGINE) == {run.label for run in RUNS}
