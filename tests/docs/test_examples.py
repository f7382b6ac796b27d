"""The examples run unchanged, and their output shows the effect that they explain."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

import pytest

from tests.docs.documents import ROOT
from tests.worlds.processes import python

pytestmark = pytest.mark.flight

EXAMPLES: Final = ROOT / "examples"
NOTEBOOK: Final = "06_notebook.ipynb"
PRINTED: Final = {
    "02_policy.py": "m flown",
    "03_drone.py": "yaw_rad=1.57",
    "04_landing.py": "from the middle of the pad",
}


def run(folder: Path, *words: str) -> str:
    """Run Python in a folder and return its output."""
    result = python(*words, folder=folder, environment={"MPLBACKEND": "agg"})
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


@pytest.mark.parametrize(("name", "printed"), PRINTED.items())
def test_an_example_flies(name: str, printed: str, tmp_path: Path) -> None:
    output = run(tmp_path, str(EXAMPLES / name))
    assert output.startswith("success"), output
    assert printed in output
    # Run from the checkout, an example leaves no file beside those of git: /out/ is ignored.
    assert {path.name for path in tmp_path.iterdir()} <= {"out"}


def test_the_notebook_runs_from_its_first_cell_to_its_last(tmp_path: Path) -> None:
    notebook = json.loads((EXAMPLES / NOTEBOOK).read_text(encoding="utf-8"))
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    text = "\n".join("".join(cell["source"]) for cell in cells)
    assert "20_000" in text
    script = tmp_path / "cells.py"
    script.write_text(text.replace("20_000", "5_000"), encoding="utf-8")  # a shorter survey
    assert run(tmp_path, str(script)).startswith("success in")
    assert (tmp_path / "out" / "notebook.png").is_file()


def test_the_example_of_a_test_passes(tmp_path: Path) -> None:
    example = str(EXAMPLES / "test_05_mission.py")
    assert "2 passed" in run(tmp_path, "-m", "pytest", "-p", "no:cacheprovider", example)


def test_the_page_lists_every_example() -> None:
    page = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    files = sorted(path.name for path in EXAMPLES.iterdir() if path.suffix in {".py", ".ipynb"})
    assert files == sorted([*PRINTED, "test_05_mission.py", NOTEBOOK])
    assert [name for name in files if f"[{name}]({name})" not in page] == []
