"""README, CONTRIBUTING and the pages of `docs/` are followed step by step.

The tables below list commands that take long or cannot run in a test. They are still parsed by
the real command, and each input file must exist: saved by the page, written by an earlier command,
or provided by the reader. `pytest -m slow tests/docs` also runs the long ones.
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Final

import pytest

from tests.docs.documents import (
    INDENTED,
    INLINE,
    INLINE_SCRIPT,
    ROOT,
    Command,
    check_inline,
    check_script,
    prose,
)
from tests.docs.reader import Reader

PAGES: Final = (
    *("README.md", "CONTRIBUTING.md", "examples/README.md"),
    *sorted(page.relative_to(ROOT).as_posix() for page in (ROOT / "docs").rglob("*.md")),
)

# Commands that take long: flights, or what needs a flight. An entry covers all that begin with it.
LONG: Final = tuple(
    f"uav-bt {words}"
    for words in (
        *("fly", "campaign", "report", "record info", "replay", "view", "doctor"),
        *("net perceive", "net collect", "net train", "net evaluate", "net export"),
        "lab film",
    )
)
# Flights of seconds, without images.
QUICK: Final = ("uav-bt fly roomy.xml",)
# Arguments that shorten those commands when they run: the last value of an option counts.
ADDED: Final = {
    "uav-bt campaign": ("--flights", "1", "--exact-masks", "--image-size", "320x180"),
    "uav-bt net perceive": ("--seconds", "1"),
    "uav-bt net collect": ("--flights", "2", "--scene", "train-a"),
    "uav-bt net train": ("--steps", "2"),
    "uav-bt net evaluate": ("--views", "20"),
    "uav-bt net export": ("--views", "4"),
    "uav-bt lab film": ("--places", "1", "--image-size", "320x180", "--scenes", "depot-train-a"),
}
# Commands that no test can run; they are only parsed.
NOT_HERE: Final = (
    # serve until Ctrl-C
    *("uav-bt serve-anafi", "uav-bt view flight.mcap --web", "uav-bt lab pick", "dask"),
    # need a drone
    *("uav-bt fly trees/hover_and_look.xml --drone", "uav-bt doctor --drone"),
    *("uav-bt fly explore_and_land_depth --drone", "uav-bt fly land_only --lab hall"),
    # need photographs, videos, picks, or the records of other flights
    *("uav-bt lab calibrate", "uav-bt lab frames", "uav-bt net perceive walk.mp4"),
    *("uav-bt lab train", "uav-bt lab check", "uav-bt lab tune-heading"),
    *("uav-bt shrink", "uav-bt report runs/soak"),
    # need a display, a cluster, a repository, or programs of others
    *("uav-bt fly land_only --scene train-a --view", "uav-bt campaign land_only --backend dask"),
    *("git worktree", "xmllint", "mcap", "python3.11 -m venv"),
    # take minutes to hours
    *("uav-bt campaign survey_and_land --drone plain", "python benchmarks", "python -m benchmarks"),
    # run tests, or are run by another
    *("python tools/kernels.py", "pytest -n 2", "pytest -m slow", "python examples"),
)
# Pages whose commands are measurements of hours.
MEASURED: Final = {"docs/results.md"}
# Python that flies or needs the files of a flight.
LONG_PYTHON: Final = ("app.fly(", "campaign.run(", "RecordedFlight(")
# Files that a reader provides.
BROUGHT: Final = {
    "docs/training.md": ("walk.mp4", "camera.yaml"),
    "docs/real-drone.md": ("boards/1.jpg",),
    "docs/network-of-my-room.md": ("runs/depot-video/train-a.mp4",),
    "docs/results.md": ("runs/depot-video/train-a.mp4",),
}


def _is_only_parsed(page: str, command: str, *, slow: bool) -> bool:
    left_out = NOT_HERE if slow else NOT_HERE + LONG
    return page in MEASURED or (command.startswith(left_out) and not command.startswith(QUICK))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return the working folder with links into the checkout; unload its modules at the end."""
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
    page: str,
    *,
    slow: bool,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    for name in BROUGHT.get(page, ()):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()
    Reader(
        page,
        folder,
        monkeypatch,
        left_out=partial(_is_only_parsed, page, slow=slow),
        added=ADDED,
        long_python=() if slow else LONG_PYTHON,
    ).follow()
    warned = [text for text in caplog.messages if text.startswith("Warning: ")]
    assert warned == [], "a reader is warned"


@pytest.mark.parametrize("page", PAGES)
def test_commands_in_the_prose_exist(page: str) -> None:
    text = prose((ROOT / page).read_text(encoding="utf-8"))
    assert INDENTED.findall(text) == [], "a block that is not fenced"
    for found in INLINE.findall(text):
        check_inline(" ".join(found.split()))
    for found in INLINE_SCRIPT.findall(text):
        check_script(Command(tuple(shlex.split(found)), line=0))
