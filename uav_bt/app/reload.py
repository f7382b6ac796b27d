"""A tree file that is edited while it flies."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from uav_bt.app.assembly import Flight
from uav_bt.app.loading import Mission, is_text, load_mission
from uav_bt.app.place import rules_of
from uav_bt.errors import InputError, TreeError, UavBtError
from uav_bt.protocols import Drone
from uav_bt.tree import MissionTree, NodeRegistry
from uav_bt.tree.loading.findings import Finding

_POLL_S: Final = 0.5  # wall time between two looks at the files


@dataclass(eq=False)
class TreeReload:
    """Gives a runner the tree of a file that was edited, and calls `note` with what comes of it.

    A missing file is awaited: editors may write into the file, or write a new one and rename it.
    """

    flight: Flight[Drone]
    path: Path
    registry: NodeRegistry | None
    note: Callable[[str], None]
    timer: Callable[[], float] = time.monotonic

    def __post_init__(self) -> None:
        self._next_s = self.timer() + _POLL_S
        self._known: dict[Path, bytes] = {}  # the files of the last tree that was tried
        self._know(self.flight.mission)

    def __call__(self) -> MissionTree | None:
        """Return the tree of the edited file. None: there is no new tree to fly."""
        if self.timer() < self._next_s:
            return None
        self._next_s = self.timer() + _POLL_S
        files = {path: data for path in self._known if (data := _content(path)) is not None}
        if files.items() <= self._known.items():
            return None
        self._known |= files
        flight = self.flight
        try:
            tree = load_mission(self.path, flight.options, self.registry)
            if rules_of(tree) != rules_of(flight.mission):
                raise InputError(f"{self.path}: its Rules differ from those before the take-off")
            if same := tree.sources == flight.mission.sources:
                self.note(f"{self.path}: again the tree that flies; it goes on")
            else:
                tree.setup(flight.context)
        except UavBtError as error:  # of the file, its leaves or policies
            for each in error.details if isinstance(error, TreeError) else ():
                if isinstance(each, Finding):  # an edit of its file may cure it
                    file = Path(each.path).resolve()
                    self._known.setdefault(file, _content(file) or b"")
            self.note(f"{error}\nThe edited tree is refused; the one before it flies on.")
            return None
        self._know(tree)
        if same:
            return None
        flight.mission = tree
        self.note(f"{self.path}: the edited tree flies, from its root on")
        return tree

    def _know(self, tree: MissionTree) -> None:
        """Keep the files that a tree was read from, with a link to its file."""
        self._known = {self.path: next(iter(tree.sources.values())), **tree.sources}


def _content(path: Path) -> bytes | None:
    """Return what a file holds; None while there is none. A pipe would block."""
    try:
        return path.read_bytes() if path.is_file() else None
    except OSError:
        return None


def reloadable_file(tree: Mission, drone: Drone, outputs: Mapping[str, Path | None]) -> Path:
    """Return the tree file to watch; refuse a real drone, and outputs."""
    if drone.live:
        raise InputError("watch: a tree is replaced in flight on simulated drones only")
    if not isinstance(tree, str | Path) or is_text(tree) or not Path(tree).is_file():
        raise InputError(
            f"watch: expected a tree file, which can be edited while it flies, got {tree!r:.80}; "
            "`uav-bt new FILE` writes one"
        )
    for what, file in outputs.items():
        if file is not None:
            raise InputError(f"watch: a {what} shows one tree, and this may change: leave one out")
    return Path(tree)
