"""Recorder of a flight: a tick listener that hands each tick to a writing thread."""

from __future__ import annotations

import json
import logging
import threading
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Final, Self

from uav_bt.board.context import MissionContext
from uav_bt.mission.tick import TickRecord
from uav_bt.record import Quality, channels, messages
from uav_bt.record.channels import END, SCHEMA_VERSION, START, CommandNote, NodeNote, TreeNote
from uav_bt.record.encoder import LogLine, MomentEncoder, RawMoment
from uav_bt.record.record_file import Attachment, RecordFile, Timeline
from uav_bt.record.values import dump, encode
from uav_bt.record.worker import RecordWorker
from uav_bt.tree import MissionTree
from uav_bt.types import CameraModel
from uav_bt.types.ground import Ground

_LOG: Final = logging.getLogger(__name__)
_LEVELS: Final = {logging.ERROR: "Error", logging.WARNING: "Warning"}
# The events of other kinds are warnings in the log.
_USUAL: Final = ("info", "expected", "phase", "photo", "landed", "ended")


class FlightRecorder:
    """Records a flight from now until `finish`, which closes the file.

    The tree is set up but not ticked yet. `start_ns` is the wall clock, since 1970.
    `facts` are metadata, structured values as JSON; `attachments` the tree's and scene's files;
    `ground` has the scene's objects, None if they are unknown.
    With `wait` the flight waits for the disk; otherwise images are omitted.
    """

    def __init__(
        self,
        file: RecordFile,
        tree: MissionTree,
        context: MissionContext,
        camera: CameraModel,
        facts: Mapping[str, str],
        *,
        attachments: Sequence[Attachment],
        ground: Ground | None,
        start_ns: int,
        quality: Quality = "lossless",
        wait: bool = False,
    ) -> None:
        self._context = context
        self._nodes = tuple(tree.nodes())
        self._file = file
        self._timeline = Timeline(start_ns=start_ns, start_s=context.clock.now())
        self._encoder = MomentEncoder(self._timeline, camera, quality)
        self._refused: tuple[str, ...] = ()
        self._ended = False
        self._dropped: Counter[str] = Counter()  # omitted messages by topic
        start = {
            "schema_version": str(SCHEMA_VERSION),
            "start_ns": str(start_ns),
            "start_s": repr(float(self._timeline.start_s)),
            "camera_model": dump(encode(camera)).decode(),
        }
        file.metadata(START, {**facts, **start})
        for attachment in attachments:
            file.attach(attachment, start_ns)
        file.write(channels.TREE, start_ns, dump(encode(self._tree_note())))
        file.write(channels.CALIBRATION, start_ns, messages.calibration(camera, start_ns))
        if ground is not None:
            lab = messages.lab_scene(ground, context.classes, start_ns)
            file.write(channels.LAB, start_ns, lab)
        file.flush()
        self._lines: list[LogLine] = []
        self._handler = _Lines(self._lines)
        self._worker = RecordWorker(self._write, file.flush, wait=wait)
        logging.getLogger().addHandler(self._handler)

    def _tree_note(self) -> TreeNote:
        parents: dict[str, int] = {}
        notes = []
        for place, one in enumerate(self._nodes):
            parents |= {child.path: place for child in one.children}
            parent = parents.get(one.path)
            notes.append(NodeNote(path=one.path, name=one.name, node_id=one.node_id, parent=parent))
        return TreeNote(nodes=tuple(notes))

    def on_tick(self, record: TickRecord) -> None:
        """Hand a tick to the writing thread."""
        self._note_changes(record)
        commands = CommandNote(
            proposed=self._context.proposals.movement,
            proposed_by=record.proposed_by,
            proposed_gimbal=self._context.proposals.gimbal,
            decided=record.decided or record.command,
            sent=record.command,
            override=record.override,
        )
        moment = RawMoment(
            tick=record,
            commands=commands,
            board=self._context.board.snapshot(),
            statuses=tuple(node.node_status for node in self._nodes),
            log=tuple(self._lines),
        )
        self._lines.clear()
        self._worker.put(moment, record.time_s)

    def _write(self, moment: RawMoment, images: bool) -> None:  # noqa: FBT001 - the worker calls it
        time_ns = self._timeline.at(moment.tick.time_s)
        for channel, data in self._encoder.encode(moment, images=images):
            if data is None:
                self._dropped[channel.topic] += 1
            else:
                self._file.write(channel, time_ns, data)

    def _note_changes(self, record: TickRecord) -> None:
        for event in record.events:
            self._log("Info" if event.kind in _USUAL else "Warning", f"{event.kind}: {event.text}")
        if record.refused != self._refused:
            self._refused = record.refused
            why = "; ".join(record.refused)
            self._log("Warning", f"refused: {why}" if why else "nothing is refused any more")

    def _log(self, level: str, message: str) -> None:
        self._lines.append((level, message, "runner"))

    def finish(self, end: Mapping[str, str]) -> str | None:
        """Write the rest with the metadata `end`, and close; return why that failed, or None.

        Losses are logged as a warning.
        """
        self._ended = True
        logging.getLogger().removeHandler(self._handler)
        self._worker.close()
        dropped, lost_ticks = self._dropped, self._worker.lost_ticks
        failure = self._worker.failure
        if failure is None:
            try:
                about = {"dropped": json.dumps(dropped), "lost_ticks": str(lost_ticks)}
                self._file.metadata(END, {**end, **about})
                self._file.finish()
            except OSError as error:
                failure = error
        losses = [f"{lost_ticks} ticks lost"] if lost_ticks else []
        losses += [f"{count} of {topic} left out" for topic, count in sorted(dropped.items())]
        why = None
        if failure is not None:
            self._file.abandon()
            why = f"not written to its end: {getattr(failure, 'strerror', None) or failure}"
            losses.insert(0, why)
        if losses:
            _LOG.warning("the flight's record is incomplete: %s", "; ".join(losses))
        return why

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        """Finish, unless that was done, with the fault if there was one."""
        if not self._ended:
            fault = {"outcome": "error", "reason": f"{type(error).__name__}: {error}"}
            self.finish({} if error is None else fault)


class _Lines(logging.Handler):
    """Collects the log lines of the flying thread."""

    def __init__(self, lines: list[LogLine]) -> None:
        super().__init__(level=logging.INFO)
        self._lines = lines
        self._thread = threading.get_ident()

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a line of this flight's thread."""
        if record.thread == self._thread:
            level = _LEVELS.get(record.levelno, "Info")
            self._lines.append((level, record.getMessage(), record.name))
