"""Rules for the whole repository: shipped files, dangerous calls, packaging."""

from __future__ import annotations

import fnmatch
import importlib.metadata
import os
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation.runtime import shipped_unet
from perception.segmentation.teacher import load_teacher
from sim_bridge.twin.scene_file import load_scene, shipped_scenes
from uav_bt import __version__
from uav_bt.lab.shipped import load_lab
from uav_bt.learning.views import TESTING_SCENES, TRAINING_SCENES, VALIDATION_SCENES

ROOT = Path(__file__).parents[1]
ROOMS = ("uav_bt", "perception", "sim_bridge", "behaviours", "trees")
PROJECT: Final[dict[str, Any]] = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
NOT_OURS = {".git", "build", "dist", "out", "runs", "shared", "__pycache__"}


def files_below(folder: Path) -> Iterator[Path]:
    for entry in sorted(folder.iterdir()):
        if (
            entry.name in NOT_OURS
            or entry.name.startswith(".venv")  # docs/real-drone.md makes a second one
            or entry.name.endswith((".egg-info", "_cache", ".hypothesis"))
            or (entry.name in ("frames", "training") and entry.parent.parent.name == "labs")
        ):
            continue
        if entry.is_dir():
            yield from files_below(entry)
        else:
            yield entry


def relative(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


MODULES = [path for room in ROOMS for path in files_below(ROOT / room) if path.suffix == ".py"]


# --- shipped files --------------------------------------------------------------------------------


def test_every_shipped_scene_loads_under_its_own_name() -> None:
    of_the_paper = {*TRAINING_SCENES, *VALIDATION_SCENES, *TESTING_SCENES}
    assert {name for name in shipped_scenes() if not name.startswith("depot-")} == of_the_paper
    for name in shipped_scenes():
        scene = load_scene(name)
        assert scene.name == name
        if name not in of_the_paper:
            assert 12 <= len(scene.objects) <= 20, name
            continue
        heights = [box.standing.height_m for box in scene.placed]
        assert len(heights) == 8
        assert (min(heights) >= 0.6, max(heights) <= 2.2) == (True, True), name
        assert sum(height >= 1.5 for height in heights) >= 4, name


def test_the_shipped_weights_load() -> None:
    assert load_teacher(SHIPPED_WEIGHTS / "teacher.safetensors", load_lab().classes).known == tuple(
        range(17)
    )
    assert shipped_unet().size_px == (224, 112)


def test_no_array_file_runs_code() -> None:
    """The linter finds all other calls that run code from data, and those that sleep."""
    running = [path for path in MODULES if "allow_pickle=True" in path.read_text(encoding="utf-8")]
    assert running == []


# --- texts ----------------------------------------------------------------------------------------

# Composed of parts, so that this file does not contain the searched words.
MACHINE = re.compile(
    "|".join(
        [
            *(rf"(?<![\w.])/{home}/\w" for home in ("root", "home", "work", "Users")),
            *(
                re.escape(f"{name}.{end}")
                for name, end in (("pypi", "org"), ("pythonhosted", "org"))
            ),
            re.escape("download.pytorch" + ".org"),
            r"//(?:localhost|\d+\.\d+\.\d+\.\d+)(?::\d+)?/(?:simple|pypi)",
        ]
    )
)
TEXTS = {".py", ".md", ".toml", ".txt", ".xml", ".yaml", ".yml", ".sh", ".csv", ".json", ".jsonl"}


def test_no_text_names_a_machine_or_a_package_host() -> None:
    named = [
        f"{relative(path)}: {found.group()}"
        for path in files_below(ROOT)
        if (path.suffix in TEXTS or path.name in {"Makefile", "run"}) and path != Path(__file__)
        for found in MACHINE.finditer(path.read_text(encoding="utf-8"))
    ]
    assert named == []


@pytest.mark.parametrize("text", ["/root/x", "see /home/me", "https://pypi" + ".org/simple"])
def test_a_machine_or_a_host_would_be_found(text: str) -> None:
    assert MACHINE.search(text)


# --- packaging ------------------------------------------------------------------------------------


def test_the_package_data_covers_every_file_that_is_no_module() -> None:
    globs = PROJECT["tool"]["setuptools"]["package-data"]
    left_out = [
        relative(path)
        for room in ROOMS
        for path in files_below(ROOT / room)
        if path.suffix != ".py"
        and not any(
            fnmatch.fnmatch(path.relative_to(ROOT / room).as_posix(), glob) for glob in globs[room]
        )
    ]
    assert left_out == []
    assert {path.suffix for path in SHIPPED_WEIGHTS.iterdir()} >= {".onnx", ".safetensors"}


def test_every_folder_with_modules_is_a_package() -> None:
    folders = {path.parent for path in MODULES}
    assert [relative(folder) for folder in folders if not (folder / "__init__.py").is_file()] == []


def test_the_version_is_the_same_everywhere() -> None:
    assert PROJECT["project"]["version"] == __version__
    assert importlib.metadata.version("uav-bt") == __version__


def test_every_entry_point_loads() -> None:
    installed = importlib.metadata.distribution("uav-bt").entry_points
    asked = {
        (group, name, value)
        for group, points in PROJECT["project"]["entry-points"].items()
        for name, value in points.items()
    }
    assert asked <= {(point.group, point.name, point.value) for point in installed}, (
        "the installed package is older than pyproject.toml: install it again"
    )
    for point in installed:
        assert point.load() is not None


def test_every_requirement_is_pinned_for_make() -> None:
    pinned = {
        line.partition("==")[0].lower().replace("_", "-")
        for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
        if "==" in line and not line.startswith("#")
    }
    asked = [*PROJECT["project"]["dependencies"]]
    for extra in PROJECT["project"]["optional-dependencies"].values():
        asked += extra
    names = {
        re.split(r"[\s<>=\[;]", line, maxsplit=1)[0].lower().replace("_", "-") for line in asked
    }
    assert names - {"uav-bt"} - pinned == set()


def test_ci_runs_what_a_person_runs() -> None:
    script = ROOT / ".ci" / "run"
    assert os.access(script, os.X_OK)
    lines = script.read_text(encoding="utf-8").splitlines()
    made = [line.split() for line in lines if " make " in f" {line}" and not line.startswith("#")]
    assert [words[-1] for words in made] == ["test", "fly"]
    assert "for kernels in avx2 baseline; do" in lines  # the choices of tools/kernels.py
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert all(f"make {words[-1]}" in readme for words in made)


def test_extras_that_exclude_each_other_are_declared_for_uv() -> None:
    """Olympe requires an old protobuf, `onnx` a newer one; uv resolves all extras together."""
    extras = PROJECT["project"]["optional-dependencies"]
    (conflict,) = PROJECT["tool"]["uv"]["conflicts"]
    excluded = {entry["extra"] for entry in conflict}
    needs_onnx = {name for name, needs in extras.items() if any("onnx>" in one for one in needs)}
    assert excluded == {"olympe", "dev", *needs_onnx}


def test_make_test_takes_no_plugins_from_a_sourced_shell() -> None:
    """After sourcing ROS, PYTHONPATH contains pytest plug-ins for another Python."""
    (line,) = (
        line for line in (ROOT / "Makefile").read_text("utf-8").splitlines() if "-m pytest" in line
    )
    assert line.strip().startswith("env -u PYTHONPATH ")
