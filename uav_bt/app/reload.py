"""A tree file that is edited while it flies: read again, checked, and flown from its root."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from uav_bt.app.assembly import Flight
from uav_bt.app.file_watch import FileWatch
from uav_bt.app.loading import Mission, is_text, load_mission
from uav_bt.app.rules import rules_of
from uav_bt.errors import InputError, TreeError, UavBtError
from uav_bt.protocols import Drone
from uav_bt.tree import MissionTree, NodeRegistry
from uav_bt.tree.loading.findings import Finding


class TreeReload:
    """Gives a runner the tree of a file that was edited: one of its `next_tree`.

    The new tree is loaded with the options and nodes of the first one, and is set up for the same
    mission. A tree that is refused is reported, and the present one flies on.

    Args:
        flight: connected; its tree is that of the file.
        path: the tree file.
        registry: Nodes that the tree may use. Default: all installed.
        note: Called with the result of each edit.
        timer: Wall clock for polling the files, seconds.
    """

    def __init__(
        self,
        flight: Flight[Drone],
        path: Path,
        registry: NodeRegistry | None,
        note: Callable[[str], None],
        *,
        timer: Callable[[], float] = time.monotonic,
    ) -> None:
        self._flight = flight
        self._path = path
        self._registry = registry
        self._note = note
        self._watch = FileWatch(self._contents(flight.mission), timer=timer)

    def __call__(self) -> MissionTree | None:
        """Return the tree of the edited file. None: there is no new tree to fly."""
        if not self._watch.changed():
            return None
        try:
            tree = self._load()
        except UavBtError as error:  # whatever is wrong with the file, its leaves or its policies
            self._watch.add(_files_of(error))
            self._note(f"{error}\nThe edited tree is refused; the one before it flies on.")
            return None
        self._watch.know(self._contents(tree))
        if rules_of(tree) != self._flight.rules:
            self._note(
                f"{self._path}: its Rules differ from those that were read before the take-off\n"
                "The edited tree is refused; the one before it flies on."
            )
            return None
        if tree.sources == self._flight.mission.sources:
            self._note(f"{self._path}: again the tree that flies; it goes on")
            return None
        self._flight.mission = tree
        self._note(f"{self._path}: the edited tree flies, from its root on")
        return tree

    def _contents(self, tree: MissionTree) -> dict[Path, bytes]:
        """Return the files that a tree was read from, with a link to its file."""
        return {self._path: next(iter(tree.sources.values())), **tree.sources}

    def _load(self) -> MissionTree:
        flight = self._flight
        tree = load_mission(self._path, flight.options, self._registry)
        if tree.sources != flight.mission.sources:
            tree.setup(flight.context)
        return tree


def _files_of(error: UavBtError) -> Iterator[Path]:
    """Yield the files in which something was found: an edit there may cure it."""
    for finding in error.details if isinstance(error, TreeError) else ():
        if isinstance(finding, Finding):
            yield Path(finding.path).resolve()


def reloadable_file(tree: Mission, drone: Drone, outputs: Mapping[str, Path | None]) -> Path:
    """Return the tree file that can be watched while it flies.

    Args:
        tree: the mission as it was given.
        drone: Drone that flies.
        outputs: files that the flight writes, by name; None where it does not.

    Raises:
        InputError: the mission is no file, the drone is real, or an output is wanted, which would
            show one tree only.
    """
    if drone.live:
        raise InputError("watch: a tree is replaced in flight on simulated drones only")
    if not isinstance(tree, str | Path) or is_text(tree) or not Path(tree).is_file():
        raise InputError(
            f"watch: expected a tree file, which can be edited while it flies, got {tree!r:.80}; "
            "`uav-bt new FILE` writes one"
        )
    for what, file in outputs.items():
        if file is not None:
            raise InputError(
                f"watch: a {what} shows one tree, and this one may change in flight: "
                f"leave {what} out, or fly without watch"
            )
    return Path(tree)
