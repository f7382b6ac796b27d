"""Reads records: whole ones, unfinished ones, and the intact parts of damaged ones.

reader = RecordReader(Path("flight.mcap"))
for moment in reader.moments():
    print(moment.tick.time_s, moment.commands.sent)
for item in footage(flight_record(Path("flight.mcap"))):  # for perception and training
    ...
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any, Final

from uav_bt.errors import BoardAccessError, FileError, InputError
from uav_bt.files import parse_json
from uav_bt.lab.classes import LabClass, LabClasses
from uav_bt.plugins import need
from uav_bt.protocols import Advice
from uav_bt.record import channels
from uav_bt.record.channels import END, SCHEMA_VERSION, START, StatusNote, TreeNote
from uav_bt.record.images import image_bytes
from uav_bt.record.moment import Moment, StoredFrame, moment_of
from uav_bt.record.record_file import Attachment, Timeline
from uav_bt.record.values import decode
from uav_bt.types import CameraModel, DroneState
from uav_bt.types.camera import FrameNote

_NS: Final = 1_000_000_000
_NEEDED: Final = {channels.TICK.topic, channels.STATE.topic, channels.COMMANDS.topic}
RECORD_SUFFIX: Final = ".mcap"

_FOOTAGE: Final[dict[str, type[Any]]] = {
    channels.ADVICE.topic: Advice,
    channels.CAMERA_FRAME.topic: FrameNote,
    channels.STATE.topic: DroneState,
}


class RecordReader:
    """One record. Opening reads its index and its beginning.

    Args:
        path: the file.

    Attributes:
        metadata: facts written at the start of the flight.
        attachments: attached files by name: the tree's files, the scene.
        timeline: converts mission seconds and record times.
        camera: camera of the drone.
        classes: classes of the lab.
        tree: the nodes, in the order of the statuses in the moments.
        finished: whether the record was closed. An unfinished one lacks index, summary and `end`.
        end: end of the flight and losses of the record; None if it was not closed.

    Raises:
        FileError: the file cannot be read, is not a flight record, or has another version.
        MissingDependencyError: the extra `record` is not installed.
    """

    def __init__(self, path: str | Path) -> None:
        need("record", "a flight record")
        from uav_bt.record.scan import RecordScan  # noqa: PLC0415 - an extra

        self.path = path = Path(path)
        self.metadata: dict[str, str] = {}
        self.attachments: dict[str, Attachment] = {}
        self.tree = TreeNote(nodes=())
        self.end: Mapping[str, str] | None = None
        self._scan = RecordScan(path)
        self.finished = self._scan.finished
        with self.intact("the metadata"):
            self._read_beginning()
            self._check_version()
            self.timeline = Timeline(
                start_ns=int(self.metadata["start_ns"]), start_s=float(self.metadata["start_s"])
            )
            self.camera = decode(CameraModel, parse_json(self.metadata["camera_model"]))
            stored = parse_json(self.metadata["classes"])
            self.classes = LabClasses(decode(LabClass, each) for each in stored)

    @property
    def damages(self) -> tuple[str, ...]:
        """The damage that the last pass found, one line each."""
        return tuple(self._scan.damages)

    @contextmanager
    def intact(self, what: str) -> Iterator[None]:
        """Raise errors of damaged content as FileError, which names file and part."""
        try:
            yield
        except FileError:
            raise
        except (BoardAccessError, InputError) as error:
            raise FileError(self.path, f"{what} of the record is damaged: {error}") from error
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            raise FileError(self.path, f"{what} of the record is damaged: {error!r}") from error

    def _read_beginning(self) -> None:
        from mcap.records import Attachment as Attached  # noqa: PLC0415 - an extra
        from mcap.records import Message, Metadata  # noqa: PLC0415

        indexed = self._scan.indexed() if self.finished else []
        all_of_it = self.finished and not indexed  # the end stands anywhere
        first_ns = None
        for topic, record in chain(((None, one) for one in indexed), self._scan):
            if isinstance(record, Metadata) and record.name == START:
                self.metadata = dict(record.metadata)
            elif isinstance(record, Metadata) and record.name == END and self.finished:
                self.end = dict(record.metadata)
            elif isinstance(record, Attached):
                attached = Attachment(record.name, record.media_type, record.data)
                self.attachments[record.name] = attached
            elif isinstance(record, Message):
                first_ns = record.log_time if first_ns is None else first_ns
                if record.log_time > first_ns and not all_of_it:
                    break  # the tree is among the first messages
                if topic == channels.TREE.topic:
                    self.tree = decode(TreeNote, parse_json(record.data))

    def _check_version(self) -> None:
        if not self.metadata:
            raise FileError(self.path, "is an MCAP file, but no flight record of uav-bt")
        version = self.metadata.get("schema_version", "")
        if version != str(SCHEMA_VERSION):
            raise FileError(
                self.path,
                f"has schema version {version}, this version of uav-bt reads {SCHEMA_VERSION}",
            )

    def messages(
        self, topics: Collection[str] | None = None, *, to_s: float | None = None
    ) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time and data of messages in the order of time; skip damaged parts.

        Args:
            topics: only these topics.
            to_s: seconds since the record's start; not included.

        Raises:
            FileError: the record cannot be read.
        """
        end_ns = self._time_ns(to_s)
        last_ns = 0
        for topic, record in self._scan:
            if topic is None:
                continue
            time_ns = record.log_time
            if time_ns < last_ns - _NS:  # a second: the writer holds back less
                raise FileError(
                    self.path,
                    f"its messages are not in the order of time (topic {topic}); `mcap sort` puts "
                    "them in order",
                )
            last_ns = max(last_ns, time_ns)
            if end_ns is not None and time_ns >= end_ns + _NS:
                return
            if (topics is None or topic in topics) and (end_ns is None or time_ns < end_ns):
                yield topic, time_ns, record.data

    def _time_ns(self, since_s: float | None) -> int | None:
        return None if since_s is None else self.timeline.start_ns + round(since_s * _NS)

    def moments(
        self, *, from_s: float | None = None, to_s: float | None = None
    ) -> Iterator[Moment]:
        """Yield the flight's ticks; images of frames are decoded on access.

        Args:
            from_s: seconds since the record's start.
            to_s: seconds since the record's start; not included.

        Raises:
            FileError: a message is damaged, although its checksum is right.
        """
        begin_ns = self._time_ns(from_s) or 0
        statuses = ("IDLE",) * len(self.tree.nodes)
        for time_ns, found in self._ticks(to_s):
            with self.intact("a tick"):
                if time_ns >= begin_ns and channels.TICK.topic in found:
                    moment = moment_of(found, statuses, self.classes)
                    statuses = moment.statuses
                else:  # statuses are recorded when they change
                    changed = found.get(channels.TREE_STATUS.topic)
                    if changed is not None:
                        statuses = decode(StatusNote, parse_json(changed)).statuses
                    continue
            yield moment

    def _ticks(self, to_s: float | None) -> Iterator[tuple[int, dict[str, bytes]]]:
        """Yield time and messages by topic of each tick, and of messages without one."""
        # A tool that sorts by time may change the order of a tick's messages.
        found: dict[str, bytes] = {}
        last_ns = 0
        for topic, time_ns, data in self.messages(to_s=to_s):
            again = topic == channels.TICK.topic and topic in found
            if found and (time_ns != last_ns or again):
                yield last_ns, found
                found = {}
            last_ns, found[topic] = time_ns, data
        if found.keys() >= _NEEDED:  # a file may be cut within its last tick
            yield last_ns, found


def flight_record(path: Path) -> RecordReader:
    """Open a finished record; FileError if it is none."""
    reader = RecordReader(path)
    if not reader.finished:
        raise FileError(path, "the record was never finished; `mcap recover` makes a whole one")
    return reader


def footage(reader: RecordReader) -> Iterator[StoredFrame | DroneState | Advice]:
    """Yield frames with an image, states and advice, in the order of time.

    Images are decoded on access. FileError if the record is damaged.
    """
    note: FrameNote | None = None
    for topic, _, data in reader.messages((*_FOOTAGE, channels.CAMERA_IMAGE.topic)):
        with reader.intact("a message"):
            if topic in _FOOTAGE:
                found = decode(_FOOTAGE[topic], parse_json(data))
            elif note is None:
                continue
            else:
                found = StoredFrame(note=note, image=image_bytes(data))
                note = None
        if isinstance(found, FrameNote):
            note = found
        else:
            yield found
    if reader.damages:
        raise FileError(
            reader.path, f"is damaged ({reader.damages[0]}); `mcap recover` saves the intact part"
        )
