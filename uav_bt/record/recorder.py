"""Recorder of a flight: a tick listener that hands each tick to a writing thread."""

from __future__ import annotations

import json
import logging
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import TracebackType
from typing import Final, Self

from uav_bt.board.context import MissionContext
from uav_bt.mission.tick import TickRecord
from uav_bt.record import channels, messages, scenes
from uav_bt.record.channels import END, SCHEMA_VERSION, START, NodeNote, TreeNote
from uav_bt.record.config import Quality
from uav_bt.record.encoder import LogLine, MomentEncoder, RawMoment
from uav_bt.record.record_file import Attachment, RecordFile, Timeline
from uav_bt.record.values import dump, encode
from uav_bt.record.worker import RecordWorker
from uav_bt.tree import MissionTree
from uav_bt.types import CameraModel, CutMotors, Land, Movement, Release, TakeOff
from uav_bt.types.flight_results import EventKind
from uav_bt.types.ground import Ground

_LOG: Final = logging.getLogger(__name__)
_LEVELS: Final = {logging.ERROR: "Error", logging.WARNING: "Warning"}
_USUAL: Final = frozenset(
    {EventKind.INFO, EventKind.PHASE, EventKind.PHOTO, EventKind.LANDED, EventKind.ENDED}
)  # the log's other events are warnings


@dataclass(frozen=True, kw_only=True)
class FlightFacts:
    """Facts about a flight before it begins."""

    values: Mapping[str, str]  # the metadata; structured values as JSON
    attachments: Sequence[Attachment] = ()  # the tree's files, the scene's
    ground: Ground | None = None  # with its objects; None: unknown


@dataclass(frozen=True, kw_only=True)
class RecordLosses:
    """Losses of a record."""

    dropped: Mapping[str, int] = field(default_factory=dict)  # omitted messages by topic
    lost_ticks: int = 0  # ticks without any message
    failure: str | None = None  # reason for an early end of the writing

    def __str__(self) -> str:
        """Return the losses in one line; empty without losses."""
        parts = [self.failure] if self.failure else []
        if self.lost_ticks:
            parts.append(f"{self.lost_ticks} ticks lost")
        parts += [f"{count} of {topic} left out" for topic, count in sorted(self.dropped.items())]
        return "; ".join(parts)


class FlightRecorder:
    """Records a flight from now until `finish`, which closes the file.

    The tree is set up but not ticked yet. `start_ns` is the wall-clock start of the record's
    timeline since 1970. With `wait` the flight waits for the disk; otherwise images are omitted.
    """

    def __init__(
        self,
        file: RecordFile,
        tree: MissionTree,
        context: MissionContext,
        camera: CameraModel,
        facts: FlightFacts,
        *,
        start_ns: int,
        quality: Quality = "lossless",
        wait: bool = False,
    ) -> None:
        self._context = context
        self._nodes = tuple(tree.nodes())
        self._file = file
        self._timeline = Timeline(start_ns=start_ns, start_s=context.clock.now())
        self._refused: tuple[str, ...] = ()
        self._movement: type[Movement] | None = None
        self._ended = False
        self.losses = RecordLosses()
        self._lines: list[LogLine] = []
        self._handler = _Lines(self._lines)
        self._begin(camera, facts)
        encoder = MomentEncoder(self._timeline, camera, quality)
        self._worker = RecordWorker(self._file, encoder.encode, wait=wait)
        logging.getLogger().addHandler(self._handler)

    def _begin(self, camera: CameraModel, facts: FlightFacts) -> None:
        at_ns = self._timeline.start_ns
        self._file.metadata(
            START,
            {
                **facts.values,
                "schema_version": str(SCHEMA_VERSION),
                "start_ns": str(at_ns),
                "start_s": repr(float(self._timeline.start_s)),
                "camera_model": dump(encode(camera)).decode(),
            },
        )
        for attachment in facts.attachments:
            self._file.attach(attachment, at_ns)
        self._file.write(channels.TREE, at_ns, dump(encode(self._tree_note())))
        self._file.write(channels.CALIBRATION, at_ns, messages.calibration(camera, at_ns))
        if facts.ground is not None:
            lab = scenes.lab_scene(facts.ground, self._context.classes, at_ns)
            self._file.write(channels.LAB, at_ns, lab)
        self._file.flush()

    def _tree_note(self) -> TreeNote:
        places = {node.path: place for place, node in enumerate(self._nodes)}
        parents = {child.path: places[node.path] for node in self._nodes for child in node.children}
        notes = (
            NodeNote(
                path=one.path, name=one.name, node_id=one.node_id, parent=parents.get(one.path)
            )
            for one in self._nodes
        )
        return TreeNote(nodes=tuple(notes))

    def on_tick(self, record: TickRecord) -> None:
        """Hand a tick to the writing thread."""
        self._note_changes(record)
        moment = RawMoment(
            tick=record,
            proposed=self._context.proposals.movement,
            proposed_gimbal=self._context.proposals.gimbal,
            board=self._context.board.snapshot(),
            statuses=tuple(node.node_status for node in self._nodes),
            log=tuple(self._lines),
        )
        self._lines.clear()
        self._worker.put(moment, record.time_s)

    def _note_changes(self, record: TickRecord) -> None:
        for event in record.events:
            self._log("Info" if event.kind in _USUAL else "Warning", f"{event.kind}: {event.text}")
        if record.refused != self._refused:
            self._refused = record.refused
            why = "; ".join(record.refused)
            self._log("Warning", f"refused: {why}" if why else "nothing is refused any more")
        kind = type(record.command.movement)
        if kind is not self._movement:
            self._movement = kind
            if kind in {TakeOff, Land, Release, CutMotors}:
                self._log("Info", f"sent: {kind.__name__}")

    def _log(self, level: str, message: str) -> None:
        self._lines.append((level, message, "runner"))

    def finish(self, end: Mapping[str, str] | None = None) -> RecordLosses:
        """Write the remaining data, index and summary, and close. Safe to call twice.

        `end` is metadata about how the flight ended. The losses are logged as a warning, too.
        """
        if self._ended:
            return self.losses
        self._ended = True
        logging.getLogger().removeHandler(self._handler)
        self._worker.close()
        dropped, lost_ticks = dict(self._worker.dropped), self._worker.lost_ticks
        failure = self._worker.failure
        if failure is None:
            try:
                about = {"dropped": json.dumps(dropped), "lost_ticks": str(lost_ticks)}
                self._file.metadata(END, {**(end or {}), **about})
                self._file.finish()
            except OSError as error:
                failure = error
        reason = None
        if failure is not None:
            self._file.abandon()
            reason = f"not written to its end: {getattr(failure, 'strerror', None) or failure}"
        self.losses = RecordLosses(dropped=dropped, lost_ticks=lost_ticks, failure=reason)
        if str(self.losses):
            _LOG.warning("the flight's record is incomplete: %s", self.losses)
        return self.losses

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Finish, also after an exception."""
        if error is not None:
            reason = f"{type(error).__name__}: {error}"
            self.finish({"outcome": "error", "reason": reason})
        self.finish()


class _Lines(logging.Handler):
    """Collects the log lines of the flying thread."""

    def __init__(self, lines: list[LogLine]) -> None:
        super().__init__(level=logging.INFO)
        self._lines = lines
        self._thread = threading.get_ident()

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a line of this flight; other flights of the process run in other threads."""
        if record.thread == self._thread:
            level = _LEVELS.get(record.levelno, "Info")
            self._lines.append((level, record.getMessage(), record.name))
