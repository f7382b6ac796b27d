"""README, CONTRIBUTING and the pages of `docs/` are followed to the letter, block by block.

What takes long, or needs what a test does not have, stands in the tables below with the reason. It
is still parsed by the real command, and every file that it reads must be there: saved by the page,
written by a command above it, or brought by the reader. `pytest -m slow tests/docs` runs the long
ones, too.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Final

import pytest

from tests.docs.documents import INDENTED, INLINE, ROOT, check_inline, prose
from tests.docs.reader import Reader

PAGES: Final = (
    *("README.md", "CONTRIBUTING.md", "examples/README.md"),
    *sorted(f"docs/{page.name}" for page in (ROOT / "docs").glob("*.md")),
)

# Commands that take long, and why. An entry stands for all commands that begin so.
LONG: Final = {
    "uav-bt fly": "a flight takes about a minute",
    "uav-bt campaign": "flights",
    "uav-bt report": "needs the flights of a campaign",
    "uav-bt record info": "needs the record of a flight",
    "uav-bt replay": "needs the record of a flight",
    "uav-bt view": "needs the record of a flight",
    "uav-bt doctor": "imports all that is installed",
    "uav-bt net perceive": "needs a video or a record",
    "uav-bt net collect": "flights",
    "uav-bt net train": "minutes to hours",
    "uav-bt net evaluate": "minutes",
    "uav-bt net export": "half a minute",
}
# What is added when those are run, so that they take less: the last value of an option counts.
ADDED: Final = {
    "uav-bt campaign": ("--flights", "1", "--exact-masks", "--image-size", "320x180"),
    "uav-bt net perceive": ("--seconds", "1"),
    "uav-bt net collect": ("--flights", "2", "--scene", "train-a"),
    "uav-bt net train teacher": ("--views", "4"),
    "uav-bt net train segmentation": ("--views", "2", "--steps", "2"),
    "uav-bt net train": ("--steps", "2"),
    "uav-bt net evaluate": ("--views", "20"),
    "uav-bt net export": ("--views", "4"),
}
# What no test can run: parsed only.
NOT_HERE: Final = {
    "uav-bt serve-anafi": "serves until Ctrl-C",
    "uav-bt fly trees/hover_and_look.xml --drone": "needs a drone",
    "uav-bt fly explore_and_land_depth --drone": "needs a drone",
    "uav-bt doctor --drone": "needs a drone",
    "uav-bt fly land_only --scene train-a --view": "needs a display",
    "uav-bt view flight.mcap --web": "serves a browser until Ctrl-C",
    "uav-bt lab calibrate": "needs photographs",
    "uav-bt net perceive walk.mp4": "needs a camera's video",
    "uav-bt net pick": "serves a browser until Ctrl-C",
    "uav-bt campaign land_only --backend dask": "needs a cluster",
    "dask": "serves until Ctrl-C",
    "mcap": "is another project's tool",
    "python benchmarks": "minutes to hours",
    "python -m benchmarks": "minutes to hours",
    "python examples": "tests/docs/test_examples.py runs them",
    "pytest -n 2": "runs other tests",
    "pytest -m slow": "runs this test",
    "python3.11 -m venv": "makes another environment",
}
# Pages whose commands were run to measure, for hours.
MEASURED: Final = {"docs/results.md"}
# Python that flies, or needs the files of a flight.
LONG_PYTHON: Final = ("app.fly(", "campaign.run(", "BtlogReader(", "RecordedFlight(")
# What a reader brings along.
BROUGHT: Final = {
    "docs/camera.md": ("boards/1.jpg", "walk.mp4"),
    "docs/anafi.md": ("boards/1.jpg",),
}


def _reason(page: str, command: str, *, slow: bool) -> str | None:
    """Return why a command of a page is only parsed, None when it is run."""
    tables = [NOT_HERE] if slow else [NOT_HERE, LONG]
    if page in MEASURED:
        return "was run to measure"
    return next(
        (why for table in tables for key, why in table.items() if command.startswith(key)), None
    )


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return the working folder, with what of the checkout the pages name; forget its modules."""
    for name in ("trees", "benchmarks", "examples", "constraints.txt"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    before = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - before:
        file = getattr(sys.modules[name], "__file__", None)
        if file is not None and Path(file).is_relative_to(tmp_path):
            del sys.modules[name]


@pytest.mark.parametrize(
    "slow", [pytest.param(False, id="fast"), pytest.param(True, id="slow", marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("page", PAGES)
def test_a_page_can_be_followed(
    page: str, *, slow: bool, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in BROUGHT.get(page, ()):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).touch()
    Reader(
        page,
        folder,
        monkeypatch,
        left_out=partial(_reason, page, slow=slow),
        added=ADDED,
        long_python=() if slow else LONG_PYTHON,
    ).follow()


@pytest.mark.parametrize("page", PAGES)
def test_commands_in_the_prose_exist(page: str) -> None:
    text = prose((ROOT / page).read_text(encoding="utf-8"))
    assert INDENTED.findall(text) == [], "a block that is not fenced"
    for found in INLINE.findall(text):
        check_inline(" ".join(found.split()))
