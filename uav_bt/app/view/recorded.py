"""A recorded flight viewed: in a window, in a browser, as a Rerun file, as a video.

with RecordedFlight(Path("flight.mcap")) as flight:
    flight.save(Path("flight.rrd"))
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import TYPE_CHECKING, Final, Self

from sim_bridge.twin.scene_file import load_scene
from uav_bt.app.film import corridor_marker, map_of_scene
from uav_bt.app.flight_record import SCENE_FILE, TREE_FOLDER
from uav_bt.app.view.live import corridor_size
from uav_bt.board import METRIC_DEPTH
from uav_bt.classes import CLASS_COLOURS, CLASS_NAMES
from uav_bt.display.lab_map import LabMap
from uav_bt.display.rerun import sinks
from uav_bt.display.rerun.setting import TreeNode, ViewSetting
from uav_bt.display.video.video import FlightVideo, FlightVideoConfig, Panes
from uav_bt.errors import FileError, TreeError
from uav_bt.mission.judge import Outcome
from uav_bt.mission.runner import TickListener
from uav_bt.progress import Advance, silent
from uav_bt.record.playback import Playback
from uav_bt.record.reader import RecordReader
from uav_bt.tree import MissionTree, load_tree

if TYPE_CHECKING:
    import rerun as rr


__all__ = ["WITHOUT_DISPLAY", "RecordedFlight", "Span", "attached_tree"]

Stopped = Callable[[], bool]


# What `uav-bt view` can do then.
WITHOUT_DISPLAY: Final = (
    "--web shows it in a browser, --save FILE.rrd keeps it for `rerun FILE.rrd` elsewhere"
)


@dataclass(frozen=True, kw_only=True)
class Span:
    """The part of a record that is shown."""

    from_s: float | None = None  # since the record's start; None: from its beginning
    to_s: float | None = None  # not included; None: to its end


class RecordedFlight:
    """A record with what its attachments tell of tree and lab. Use it as a context manager.

    Args:
        path: the record.
        span: what of it is shown.

    Raises:
        FileError: it cannot be read, is no flight record, or is of a newer version.
        MissingDependencyError: the extra `record` is not installed.
    """

    def __init__(self, path: Path, span: Span | None = None) -> None:
        self.reader = RecordReader(path)
        self._span = span or Span()
        self._folder = TemporaryDirectory(prefix="uav-bt-record-")
        try:
            root = Path(self._folder.name).resolve()
            self._unpack(root)
            self.tree = attached_tree(self.reader, root)
            scene = root / SCENE_FILE
            self.lab_map: LabMap | None = (
                map_of_scene(load_scene(scene)) if scene.is_file() else None
            )
        except BaseException:
            self._folder.cleanup()
            raise

    def _unpack(self, root: Path) -> None:
        for name, attachment in self.reader.attachments.items():
            file = (root / name).resolve()
            if not file.is_relative_to(root):
                raise FileError(
                    self.reader.path, f"its attachment '{name}' points out of its folder"
                )
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(attachment.data)

    @property
    def title(self) -> str:
        """The mission, the scene, the seed."""
        told: Mapping[str, str] = self.reader.metadata
        words = [Path(told.get("tree", self.reader.path.name)).stem]
        words += [told[name] for name in ("scene",) if told.get(name) not in (None, "", "null")]
        words += [f"seed {told['seed']}"] if "seed" in told else []
        return ", ".join(words)

    @property
    def damages(self) -> tuple[str, ...]:
        """What of the record is not whole, as far as it has been read."""
        unfinished = () if self.reader.finished else ("it was never finished",)
        return (*unfinished, *self.reader.damages)

    def setting(self) -> ViewSetting:
        """Return what a view shows that does not change while the flight lasts."""
        reader, tree = self.reader, self.tree
        nodes = reader.tree.nodes
        return ViewSetting(
            camera=reader.camera,
            class_names=CLASS_NAMES,
            class_colours=CLASS_COLOURS,
            title=self.title,
            lab_map=self.lab_map,
            tree=tuple(
                TreeNode(
                    path=node.path,
                    label=node.name,
                    parent=None if node.parent is None else nodes[node.parent].path,
                )
                for node in nodes
            ),
            makes_depth=tree is not None
            and any(METRIC_DEPTH in leaf.writes for leaf in tree.leaves()),
            corridor=None if tree is None else corridor_size(tree),
            intruding=None if tree is None else corridor_marker(tree, reader.camera),
        )

    def draw(
        self,
        stream: rr.RecordingStream,
        *,
        advance: Advance = silent,
        stopped: Stopped = lambda: False,
    ) -> None:
        """Draw the flight into a Rerun recording.

        Args:
            stream: open.
            advance: told how many ticks are drawn.
            stopped: asked whether nobody looks any more.

        Raises:
            FileError: the record has no tick there, or one that cannot be read.
        """
        from uav_bt.display.rerun.flight_view import FlightView  # noqa: PLC0415 - needs Rerun
        from uav_bt.display.rerun.layout import layout  # noqa: PLC0415

        setting, playback = self.setting(), Playback(self.reader)
        stream.send_blueprint(layout(setting))
        view = FlightView(
            stream, setting, playback.board, playback.statuses, start_s=playback.start_s
        )
        self._play(playback, view, "view", advance, stopped)

    def _play(
        self,
        playback: Playback,
        listener: TickListener,
        stage: str,
        advance: Advance,
        stopped: Stopped = lambda: False,
    ) -> None:
        total, done = self._ticks(), 0
        for record in playback.ticks(from_s=self._span.from_s, to_s=self._span.to_s):
            listener.on_tick(record)
            done += 1
            advance(stage, min(done, total), total)
            if stopped():
                return
        advance(stage, done, done)
        if not done:
            raise FileError(
                self.reader.path, "the record has no tick in the part that was asked for"
            )

    def _ticks(self) -> int:
        """Return how many ticks the whole flight has; 1 where the record does not say."""
        end = self.reader.end or {}
        try:
            return int(json.loads(end["report"])["ticks"])
        except (KeyError, TypeError, ValueError):  # only for a progress bar
            return 1

    def save(self, path: Path, *, advance: Advance = silent) -> None:
        """Write the view as an rrd file, which appears whole or not at all.

        Raises:
            FileError: it cannot be written, or the record not be read.
            MissingDependencyError: Rerun is not installed.
        """
        with sinks.saved(path) as stream:
            self.draw(stream, advance=advance)

    @contextmanager
    def shown(self, *, web: bool) -> Iterator[sinks.Viewer]:
        """Open a viewer, to `draw` into its stream; a browser's view ends with the context.

        Raises:
            InputError: there is no display.
            MissingDependencyError: Rerun is not installed.
        """
        if not web:
            sinks.need_display(WITHOUT_DISPLAY)
        viewer = sinks.Viewer(web=web)
        try:
            yield viewer
        finally:
            viewer.close(end=web)

    def film(self, path: Path, *, speed: float = 1.0, advance: Advance = silent) -> None:
        """Write the flight as a video: camera, mask, depth, map and the active branch.

        Raises:
            FileError: the video cannot be written, or the record not be read.
            MissingDependencyError: no video encoder works here.
        """
        reader, playback = self.reader, Playback(self.reader)
        panes = Panes(
            playback.board,
            reader.camera,
            class_colours=CLASS_COLOURS,
            lab_map=self.lab_map,
            title=self.title,
        )
        if self.tree is not None and any(
            METRIC_DEPTH in leaf.writes for leaf in self.tree.leaves()
        ):
            panes.show_depth(corridor_marker(self.tree, reader.camera))
        with FlightVideo(path, panes, FlightVideoConfig(speed=speed)) as video:
            self._play(playback, video, "video", advance)
            end = reader.end
            if end is not None and end.get("outcome"):
                outcome = end["outcome"]
                good = outcome == Outcome.SUCCESS.value
                video.conclude(outcome.replace("_", " "), [end.get("reason", "")], good=good)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        self._folder.cleanup()


def attached_tree(reader: RecordReader, folder: Path) -> MissionTree | None:
    """Return the tree that a record was flown with.

    Args:
        reader: of the record.
        folder: where its attachments have been written.

    Returns:
        None where it has none, or one of nodes that are not installed here: what the record says of
        it is enough for the graph, not for the corridor.
    """
    file = folder / TREE_FOLDER / reader.metadata.get("tree", "")
    if not file.is_file():
        return None
    try:
        return load_tree(file)
    except TreeError:
        return None
