"""A flight's record, composed: what the recorder needs to know about this lab and this machine.

`app.fly(tree, FlightOptions(record=Path("flight.mcap")))` does all of it.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import platform
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from functools import lru_cache
from importlib import resources
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import yaml

import uav_bt
from sim_bridge.twin.scene import Scene
from uav_bt.board.context import MissionContext
from uav_bt.errors import FileError
from uav_bt.files import writing
from uav_bt.mission.flight_report import FlightReport
from uav_bt.protocols import Drone
from uav_bt.record.config import Quality, RecordConfig
from uav_bt.record.record_file import Attachment, RecordFile
from uav_bt.record.recorder import FlightFacts, FlightRecorder
from uav_bt.tree import MissionTree
from uav_bt.tree.loading.source import Element, parse_source, read_source

__all__ = [
    "SCENE_FILE",
    "TREE_FOLDER",
    "FlightRecord",
    "conclusion",
    "flight_facts",
    "scene_text",
]

TREE_FOLDER: Final = "tree/"  # attachments below are the tree's files, as they lie beside it
SCENE_FILE: Final = "scene.yaml"

# What a flight's result may depend on.
_PACKAGES: Final = ("numpy", "opencv-python-headless", "openvino", "mujoco", "py_trees", "filterpy")
_GIT_PATIENCE_S: Final = 5.0


def flight_facts(
    tree: MissionTree, path: Path, drone: Drone, values: Mapping[str, object]
) -> FlightFacts:
    """Return what is known of a flight before it begins.

    Args:
        tree: the mission, set up.
        path: its file.
        drone: connected.
        values: the flight's options; what is no text becomes JSON.
    """
    scene = getattr(drone, "scene", None)  # simulated drones have one
    attachments = list(_tree_files(path))
    if isinstance(scene, Scene):
        attachments.append(_scene_file(scene))
    told = {
        "uav_bt": uav_bt.__version__,
        "started": datetime.now(tz=UTC).isoformat(timespec="seconds"),
        "tree": path.name,
        "tree_name": tree.name,
        "scene": getattr(scene, "name", None),
        "simulated": drone.referee is not None,
        "versions": {name: _version(name) for name in _PACKAGES},
        "platform": f"{platform.platform()}, Python {platform.python_version()}",
        "git": dict(_git_state()),
        "weights": _weights(tree),
        **values,
    }
    return FlightFacts(
        values={name: _text(value) for name, value in told.items()}, attachments=attachments
    )


def conclusion(report: FlightReport) -> dict[str, str]:
    """Return how a flight ended, as a record's last metadata."""
    return {
        "outcome": report.outcome,
        "reason": report.reason,
        "report": json.dumps(report.to_json()),
    }


class FlightRecord:
    """The record of one flight: begun when the tree is set up, closed whatever happens.

    Args:
        path: the MCAP file.
        options: the flight's, as metadata; what is no text becomes JSON.
        quality: of camera pictures.
        realtime: the flight must keep pace with the clock on the wall. One whose clock stands still
            meanwhile waits for the disk, and nothing is left out.
        wall_clock_ns: tells when the flight begins, nanoseconds since 1970.
    """

    def __init__(
        self,
        path: Path,
        options: Mapping[str, object],
        *,
        quality: Quality = "lossless",
        realtime: bool = False,
        wall_clock_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._path = path
        self._options = options
        self._quality = quality
        self._realtime = realtime
        self._wall_clock_ns = wall_clock_ns
        self._recorder: FlightRecorder | None = None

    def begin(
        self, tree: MissionTree, path: Path, drone: Drone, context: MissionContext
    ) -> FlightRecorder:
        """Open the file; return what listens to the ticks.

        Args:
            tree: set up, not ticked yet.
            path: its file.
            drone: connected.
            context: of the mission.

        Raises:
            FileError: the file cannot be written.
            MissingDependencyError: the extra `record` is not installed.
        """
        before_s = drone.clock.now()
        facts = flight_facts(tree, path, drone, self._options)
        stands_still = drone.clock.now() == before_s  # nobody has slept, and yet time has passed
        config = RecordConfig(quality=self._quality, wait=stands_still and not self._realtime)
        file = RecordFile(self._path)
        try:
            with writing(self._path):
                self._recorder = FlightRecorder(
                    file,
                    tree,
                    context,
                    drone.camera,
                    facts,
                    start_ns=self._wall_clock_ns(),
                    config=config,
                )
        except FileError:
            file.abandon()
            raise
        return self._recorder

    def conclude(self, report: FlightReport) -> None:
        """Close the file with how the flight ended."""
        if self._recorder is not None:
            self._recorder.finish(conclusion(report))

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the file, with the fault if there was one."""
        if self._recorder is not None:
            self._recorder.__exit__(kind, error, trace)


def _tree_files(path: Path) -> Iterator[Attachment]:
    """Yield a tree file and all that it includes, named by where they lie from its folder."""
    home = path.resolve().parent
    waiting, seen = [path.resolve()], set[Path]()
    while waiting:
        file = waiting.pop()
        if file in seen:
            continue
        seen.add(file)
        data = read_source(file)
        yield Attachment(
            name=f"{TREE_FOLDER}{file.relative_to(home).as_posix()}",
            media_type="application/xml",
            data=data,
        )
        waiting += [
            (file.parent / element.attributes["path"]).resolve()
            for element in _elements(parse_source(data, file))
            if element.tag == "include" and "path" in element.attributes
        ]


def _elements(root: Element) -> Iterator[Element]:
    yield root
    for child in root.children:
        yield from _elements(child)


def scene_text(scene: Scene) -> str:
    """Return a scene as the text of a scene file."""
    values, start = _plain(asdict(scene)), scene.take_off
    spot = "helipad" if start.position_m is None else list(start.position_m)
    values["take_off"] = (
        {"from": "random"} if start.random else {"from": spot, "yaw_deg": start.yaw_deg}
    )
    return yaml.safe_dump(values, sort_keys=False)


def _scene_file(scene: Scene) -> Attachment:
    return Attachment(
        name=SCENE_FILE, media_type="application/yaml", data=scene_text(scene).encode()
    )


def _weights(tree: MissionTree) -> dict[str, str]:
    """Return the checksums of all networks that the flight may use, by file."""
    shipped = Path(str(resources.files("perception"))) / "weights"
    named = [
        Path(str(leaf.port_value(port.name)))
        for leaf in tree.leaves()
        for port in leaf.ports
        if port.name in {"model", "classes"} and leaf.reference(port) is None
    ]
    files = sorted(file for file in shipped.iterdir() if file.is_file())
    return {
        file.name if file.parent == shipped else str(file): _sha256(file, file.stat().st_mtime_ns)
        for file in [*files, *(file for file in named if file.is_file())]
    }


@lru_cache(maxsize=64)
def _sha256(file: Path, _changed_ns: int) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


@lru_cache(maxsize=1)
def _git_state() -> tuple[tuple[str, object], ...]:
    """Return commit and cleanness of the checkout that this runs from; nothing without one."""
    home = Path(uav_bt.__file__).resolve().parents[1]
    git = shutil.which("git")
    if git is None or not (home / ".git").exists():
        return ()
    commit = _git([git, "-C", str(home), "rev-parse", "HEAD"])
    changed = _git([git, "-C", str(home), "status", "--porcelain", "--untracked-files=no"])
    if commit is None or changed is None:
        return ()
    return ("commit", commit.strip()), ("changed", bool(changed.strip()))


def _git(command: Sequence[str]) -> str | None:
    try:
        done = subprocess.run(  # noqa: S603 - git itself, found on the path, with our own words
            command, capture_output=True, text=True, check=True, timeout=_GIT_PATIENCE_S
        )
    except (OSError, subprocess.SubprocessError):
        return None  # a record without a commit is better than no flight
    return done.stdout


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _text(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value, default=str)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value
