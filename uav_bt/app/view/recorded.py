"""A recorded flight viewed: in a window, in a browser, as a Rerun file, as a video.

RecordedFlight(Path("flight.mcap")).save(Path("flight.rrd"))
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Final

from sim_bridge.twin.scene_file import load_scene
from uav_bt.app.film import facts_of, map_of_scene
from uav_bt.app.flight_outputs import PathLog
from uav_bt.app.flight_record import SCENE_FILE, recorded_options, recorded_tree
from uav_bt.board import SITE_MAP
from uav_bt.display.lab_map import LabMap
from uav_bt.display.phrases import describe_flight
from uav_bt.display.rerun import sinks
from uav_bt.display.shown import FlightFacts
from uav_bt.display.video.video import FlightVideo, open_film
from uav_bt.errors import FileError, InputError, TreeError
from uav_bt.files import parse_json, write_whole
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.protocols import Advance, silent
from uav_bt.record.playback import Playback
from uav_bt.record.reader import RecordReader
from uav_bt.tree import MissionTree, parse_tree

if TYPE_CHECKING:
    import numpy as np
    import rerun as rr
    from numpy.typing import NDArray

    from uav_bt.types import SiteMap

# Options of `uav-bt view` without a display.
WITHOUT_DISPLAY: Final = (
    "--web shows it in a browser, --save FILE.rrd keeps it for `rerun FILE.rrd` elsewhere"
)


class RecordedFlight:
    """A record with its tree and its lab, as far as they are known here.

    Args:
        path: the record.
        from_s: Start of the part that is shown, seconds since the record's start.
        to_s: Its end, not included.

    Raises:
        FileError: it cannot be read, is not a flight record, or is of another version.
        MissingDependencyError: the extra `record` is not installed.
    """

    def __init__(
        self, path: str | Path, *, from_s: float | None = None, to_s: float | None = None
    ) -> None:
        self.reader = RecordReader(path)
        self._from_s = from_s
        self._to_s = to_s
        self.tree: MissionTree | None = None  # None where it has nodes that are not installed
        self._lab_map: LabMap | None = None  # None where the files of its lab are missing
        if (tree := recorded_tree(self.reader)) is not None:
            with suppress(TreeError):
                self.tree = parse_tree(tree, tree_id=self.reader.metadata.get("tree_name"))
        if (scene := self.reader.attachments.get(SCENE_FILE)) is not None:
            with TemporaryDirectory(prefix="uav-bt-record-") as folder, suppress(InputError):
                file = Path(folder, SCENE_FILE)
                write_whole(file, scene.data)
                self._lab_map = map_of_scene(load_scene(file))

    @cached_property
    def facts(self) -> FlightFacts:
        """What does not change during the flight, as far as it is known here."""
        reader, options = self.reader, recorded_options(self.reader)
        mission = reader.metadata.get("tree", reader.path.name)
        scene, drone, seed = options.scene, options.drone, options.seed
        return facts_of(
            self.tree,
            reader.camera,
            classes=reader.classes,
            title=describe_flight(mission, scene=scene, drone=drone, seed=seed),
            lab_map=self._lab_map,
            nodes=tuple((node.path, node.name) for node in reader.tree.nodes),
            limit_s=options.judge.limit_s,
            start_s=reader.timeline.start_s,
        )

    @property
    def damages(self) -> tuple[str, ...]:
        """Damages of the record, as far as it has been read."""
        unfinished = () if self.reader.finished else ("it was never finished",)
        return (*unfinished, *self.reader.damages)

    def path(self) -> NDArray[np.float64]:
        """Return the flown path, (N, 5); see `uav_bt.app.FlownMission.path`."""
        return PathLog(self._ticks(Playback(self.reader))).array()

    def maps(self) -> Iterator[tuple[float, SiteMap]]:
        """Yield the recorded site maps, two per second, each with its time in mission seconds."""
        playback, last = Playback(self.reader), None
        for tick in self._ticks(playback):
            site_map = playback.board.read(SITE_MAP).value
            # Between two recorded maps only the obstacles near the drone are new.
            if site_map is not None and site_map.seen_s is not last:
                yield tick.time_s, site_map
                last = site_map.seen_s

    def draw(
        self,
        stream: rr.RecordingStream,
        *,
        advance: Advance = silent,
        stopped: Callable[[], bool] = lambda: False,
    ) -> None:
        """Draw the flight into an open Rerun recording, until the viewer was closed."""
        from uav_bt.display.rerun.flight_view import FlightView  # noqa: PLC0415  (needs Rerun)

        playback = Playback(self.reader)
        view = FlightView(stream, self.facts, playback.board, playback.statuses)
        self._play(playback, view, "view", advance, stopped)

    def _ticks(self, playback: Playback) -> Iterator[TickRecord]:
        return playback.ticks(from_s=self._from_s, to_s=self._to_s)

    def _play(
        self,
        playback: Playback,
        listener: TickListener,
        stage: str,
        advance: Advance,
        stopped: Callable[[], bool] = lambda: False,
    ) -> None:
        done, total = 0, 1  # the whole flight's, for a progress bar
        with suppress(InputError, KeyError, TypeError, ValueError, OverflowError):
            total = int(parse_json((self.reader.end or {})["report"])["ticks"])
        for record in self._ticks(playback):
            listener.on_tick(record)
            done += 1
            advance(stage, min(done, total), total)
            if stopped():
                return
        advance(stage, done, done)
        if not done:
            raise FileError(self.reader.path, "it has no tick in the part that was asked for")

    def save(self, path: str | Path, *, advance: Advance = silent) -> None:
        """Write the view as an rrd file, which appears whole or not at all.

        FileError if it cannot be written, or the record not be read. `advance` gets the ticks.
        """
        with sinks.saved(Path(path)) as stream:
            self.draw(stream, advance=advance)

    def film(self, path: str | Path, *, speed: float = 1.0, advance: Advance = silent) -> None:
        """Write the flight as an mp4 file: camera, mask, depth, map and the active branch.

        FileError if it cannot be written, or the record not be read. `speed` is relative to the
        mission; `advance` gets the ticks.
        """
        playback, end = Playback(self.reader), self.reader.end or {}
        with closing(open_film(Path(path), speed)) as file:
            video = FlightVideo(file, playback.board, self.facts)
            try:
                self._play(playback, video, "video", advance)
            except BaseException:
                file.discard()  # half of one must not replace a whole one
                raise
            if end.get("outcome"):
                video.conclude(end["outcome"], [end.get("reason", "")])
