"""A recorded flight viewed: in a window, in a browser, as a Rerun file, as a video.

RecordedFlight(Path("flight.mcap")).save(Path("flight.rrd"))
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Final

from sim_bridge.twin.scene_file import load_scene
from uav_bt.app.film import depth_of, map_of_scene
from uav_bt.app.flight_outputs import PathLog
from uav_bt.app.flight_record import recorded_files, recorded_options
from uav_bt.app.view.live import setting_of
from uav_bt.board import SITE_MAP
from uav_bt.display.phrases import describe_flight
from uav_bt.display.rerun import sinks
from uav_bt.display.video.video import FlightVideo, Panes
from uav_bt.errors import FileError, InputError, TreeError
from uav_bt.files import parse_json
from uav_bt.mission.judge import Outcome
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.progress import Advance, silent
from uav_bt.record.playback import Playback
from uav_bt.record.reader import RecordReader
from uav_bt.tree import MissionTree, load_tree

if TYPE_CHECKING:
    import numpy as np
    import rerun as rr
    from numpy.typing import NDArray

    from uav_bt.display.rerun.layout import ViewSetting
    from uav_bt.types import SiteMap

Stopped = Callable[[], bool]

# Options of `uav-bt view` without a display.
WITHOUT_DISPLAY: Final = (
    "--web shows it in a browser, --save FILE.rrd keeps it for `rerun FILE.rrd` elsewhere"
)


@dataclass(frozen=True, kw_only=True)
class Span:
    """The part of a record that is shown."""

    from_s: float | None = None  # since the record's start; None: from its beginning
    to_s: float | None = None  # not included; None: to its end


class RecordedFlight:
    """A record with the tree and the lab of its attachments, each as far as it is known here.

    Args:
        path: the record.
        span: Part of the record that is shown.

    Raises:
        FileError: it cannot be read, is not a flight record, or is of another version.
        MissingDependencyError: the extra `record` is not installed.
    """

    def __init__(self, path: str | Path, span: Span | None = None) -> None:
        self.reader = RecordReader(path)
        self._span = span or Span()
        self.tree: MissionTree | None = None  # None where it has nodes that are not installed
        self.lab_map = None  # None where the files of its lab are missing
        with TemporaryDirectory(prefix="uav-bt-record-") as folder:
            files = recorded_files(self.reader, Path(folder))
            if files.tree is not None:
                with suppress(TreeError):
                    self.tree = load_tree(files.tree, tree_id=self.reader.metadata.get("tree_name"))
            if files.scene is not None:
                with suppress(InputError):
                    self.lab_map = map_of_scene(load_scene(files.scene))

    @property
    def title(self) -> str:
        """The mission, the scene, the seed."""
        options = recorded_options(self.reader)
        tree = self.reader.metadata.get("tree", self.reader.path.name)
        return describe_flight(tree, scene=options.scene, drone=options.drone, seed=options.seed)

    @property
    def damages(self) -> tuple[str, ...]:
        """Damages of the record, as far as it has been read."""
        unfinished = () if self.reader.finished else ("it was never finished",)
        return (*unfinished, *self.reader.damages)

    def path(self) -> NDArray[np.float64]:
        """Return the flown path, (N, 5); see `uav_bt.app.FlownMission.path`."""
        return PathLog(self._shown(Playback(self.reader))).array()

    def maps(self) -> Iterator[tuple[float, SiteMap]]:
        """Yield the recorded site maps, two per second, each with its time in mission seconds."""
        playback, last = Playback(self.reader), None
        for tick in self._shown(playback):
            site_map = playback.board.read(SITE_MAP).value
            # Between two recorded maps only the obstacles near the drone are new.
            if site_map is not None and site_map.seen_s is not last:
                yield tick.time_s, site_map
                last = site_map.seen_s

    def setting(self) -> ViewSetting:
        """Return what does not change during the flight, for a view."""
        reader, levels = self.reader, list[int]()
        for node in reader.tree.nodes:  # parents first
            levels.append(0 if node.parent is None else levels[node.parent] + 1)
        nodes = zip(reader.tree.nodes, levels, strict=True)
        return setting_of(
            self.tree,
            reader.camera,
            classes=reader.classes,
            airframe=recorded_options(reader).airframe,
            tree=tuple((node.path, node.name, level) for node, level in nodes),
            lab_map=self.lab_map,
            title=self.title,
        )

    def draw(
        self,
        stream: rr.RecordingStream,
        *,
        advance: Advance = silent,
        stopped: Stopped = lambda: False,
    ) -> None:
        """Draw the flight into an open Rerun recording, until the viewer was closed.

        Raises:
            FileError: the record has no tick there, or one that cannot be read.
        """
        from uav_bt.display.rerun.flight_view import FlightView  # noqa: PLC0415 - needs Rerun
        from uav_bt.display.rerun.layout import layout  # noqa: PLC0415

        setting, playback = self.setting(), Playback(self.reader)
        stream.send_blueprint(layout(setting))
        board, start_s = playback.board, playback.start_s
        view = FlightView(stream, setting, board, playback.statuses, start_s=start_s)
        self._play(playback, view, "view", advance, stopped)

    def _shown(self, playback: Playback) -> Iterator[TickRecord]:
        return playback.ticks(from_s=self._span.from_s, to_s=self._span.to_s)

    def _play(
        self,
        playback: Playback,
        listener: TickListener,
        stage: str,
        advance: Advance,
        stopped: Stopped = lambda: False,
    ) -> None:
        done, total = 0, 1  # the whole flight's, for a progress bar
        with suppress(InputError, KeyError, TypeError, ValueError, OverflowError):
            total = int(parse_json((self.reader.end or {})["report"])["ticks"])
        for record in self._shown(playback):
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

    def save(self, path: str | Path, *, advance: Advance = silent) -> None:
        """Write the view as an rrd file, which appears whole or not at all.

        Args:
            path: the file.
            advance: called with the number of ticks drawn.

        Raises:
            FileError: it cannot be written, or the record not be read.
            MissingDependencyError: Rerun is not installed.
        """
        with sinks.saved(Path(path)) as stream:
            self.draw(stream, advance=advance)

    def shown(self, *, web: bool) -> AbstractContextManager[sinks.Viewer]:
        """Open a viewer, to `draw` into its stream; a browser's view ends with the context.

        Raises:
            InputError: there is no display.
            MissingDependencyError: Rerun is not installed.
        """
        return sinks.shown(web=web, instead=WITHOUT_DISPLAY)

    def film(self, path: str | Path, *, speed: float = 1.0, advance: Advance = silent) -> None:
        """Write the flight as a video: camera, mask, depth, map and the active branch.

        Args:
            path: the mp4 file.
            speed: Speed of the video relative to the mission.
            advance: called with the number of ticks drawn.

        Raises:
            FileError: the video cannot be written, or the record not be read.
            MissingDependencyError: no video encoder works here.
        """
        reader, playback = self.reader, Playback(self.reader)
        panes = Panes(
            playback.board,
            reader.camera,
            lab_map=self.lab_map,
            title=self.title,
            limit_s=recorded_options(reader).judge.limit_s,
            **depth_of(self.tree, reader.camera),
        )
        with FlightVideo(Path(path), panes, speed=speed) as video:
            try:
                self._play(playback, video, "video", advance)
            except BaseException:
                video.file.discard()  # half of one must not replace a whole one
                raise
            end = reader.end or {}
            if end.get("outcome"):
                outcome = end["outcome"]
                good = outcome == Outcome.SUCCESS.value
                video.conclude(outcome.replace("_", " "), [end.get("reason", "")], good=good)
