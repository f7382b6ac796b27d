"""Reads records: whole ones, unfinished ones, and the intact parts of damaged ones.

reader = RecordReader(Path("flight.mcap"))
for moment in reader.moments():
    print(moment.tick.time_s, moment.commands.sent)
for item in footage(flight_record(Path("flight.mcap"))):  # for perception and training
    ...
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, Final

from uav_bt.errors import FileError, InputError
from uav_bt.files import parse_json
from uav_bt.lab.classes import LabClass, LabClasses
from uav_bt.plugins import need
from uav_bt.protocols import Advice
from uav_bt.record import channels
from uav_bt.record.channels import END, SCHEMA_VERSION, START, FrameNote, StatusNote, TreeNote
from uav_bt.record.images import image_bytes
from uav_bt.record.moment import Moment, StoredFrame, moment_of
from uav_bt.record.record_file import Attachment, Timeline
from uav_bt.record.values import decode
from uav_bt.types import CameraModel, DroneState

_NS: Final = 1_000_000_000
_NEEDED: Final = {channels.TICK.topic, channels.STATE.topic, channels.COMMANDS.topic}
RECORD_SUFFIX: Final = ".mcap"

_DECODED: Final[dict[str, type[Any]]] = {
    channels.ADVICE.topic: Advice,
    channels.CAMERA_FRAME.topic: FrameNote,
    channels.STATE.topic: DroneState,
}


@dataclass(frozen=True, kw_only=True)
class StoredMessage:
    """A message of the file, not decoded."""

    topic: str
    time_ns: int  # on the record's timeline
    data: bytes


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
        from uav_bt.record.scan import RecordScan, is_finished  # noqa: PLC0415 - an extra

        self.path = path = Path(path)
        self.metadata: dict[str, str] = {}
        self.attachments: dict[str, Attachment] = {}
        self.tree = TreeNote(nodes=())
        self.finished = is_finished(path)
        self.end: Mapping[str, str] | None = None
        self._scan = RecordScan(path)
        try:
            self._read_beginning()
        except InputError as error:
            raise self._damaged("metadata", error) from error
        self._check_version()
        try:
            self.timeline = Timeline(
                start_ns=int(self.metadata["start_ns"]), start_s=float(self.metadata["start_s"])
            )
            self.camera = decode(CameraModel, parse_json(self.metadata["camera_model"]))
            stored = parse_json(self.metadata["classes"])
            self.classes = LabClasses(decode(LabClass, each) for each in stored)
        except (KeyError, ValueError, OverflowError, InputError) as error:
            raise self._damaged("metadata", error) from error

    @property
    def damages(self) -> tuple[str, ...]:
        """The damage that the last pass found, one line each."""
        return tuple(self._scan.damages)

    def _read_beginning(self) -> None:
        from mcap.records import Attachment as Attached  # noqa: PLC0415 - an extra
        from mcap.records import Message, Metadata  # noqa: PLC0415

        self._summary: Any = None
        indexed: list[Any] = []
        if self.finished:
            self._summary, indexed = self._index()
        all_of_it = self.finished and self._summary is None  # the end stands anywhere
        first_ns, topics = None, dict[int, str]()
        for record in chain(indexed, self._scan.records(None, topics)):
            if isinstance(record, Metadata) and record.name == START:
                self.metadata = dict(record.metadata)
            elif isinstance(record, Metadata) and record.name == END and self.finished:
                self.end = dict(record.metadata)
            elif isinstance(record, Attached):
                self.attachments[record.name] = Attachment(
                    name=record.name, media_type=record.media_type, data=record.data
                )
            elif isinstance(record, Message):
                first_ns = record.log_time if first_ns is None else first_ns
                if record.log_time > first_ns and not all_of_it:
                    break  # the tree is among the first messages
                if topics[record.channel_id] == channels.TREE.topic:
                    self.tree = decode(TreeNote, parse_json(record.data))

    def _index(self) -> tuple[Any, list[Any]]:
        """Return the summary, and metadata and attachments, which may stand behind the messages."""
        from mcap.reader import SeekingReader  # noqa: PLC0415 - an extra

        with self.path.open("rb") as stream:
            try:
                reader = SeekingReader(stream, validate_crcs=True)
                found = [*reader.iter_metadata(), *reader.iter_attachments()]
                return reader.get_summary(), found
            except Exception:  # noqa: BLE001 - a damaged index raises anything in the parser
                return None, []

    def _check_version(self) -> None:
        if not self.metadata:
            raise FileError(self.path, "is an MCAP file, but no flight record of uav-bt")
        version = self.metadata.get("schema_version", "")
        if not version.isdecimal():
            raise FileError(self.path, f"the record's version is damaged: '{version}'")
        if int(version) != SCHEMA_VERSION:
            raise FileError(
                self.path,
                f"has schema version {version}, this version of uav-bt reads {SCHEMA_VERSION}",
            )

    def messages(
        self,
        topics: Collection[str] | None = None,
        *,
        from_s: float | None = None,
        to_s: float | None = None,
    ) -> Iterator[StoredMessage]:
        """Yield messages in the order of time; damaged parts are skipped.

        Args:
            topics: only these topics.
            from_s: seconds since the record's start; earlier parts of a finished record are not
                read.
            to_s: seconds since the record's start; not included.

        Raises:
            FileError: the record cannot be read.
        """
        from mcap.records import Message  # noqa: PLC0415 - an extra

        start_ns = 0 if from_s is None else self.timeline.start_ns + round(from_s * _NS)
        end_ns = None if to_s is None else self.timeline.start_ns + round(to_s * _NS)
        chunks: list[Any] | None = None
        known: dict[int, str] = {}
        if from_s is not None or to_s is not None:
            chunks, known = self._chunks(topics, start_ns, end_ns)
        last_ns = 0
        for record in self._scan.records(chunks, known):
            if not isinstance(record, Message):
                continue
            topic, time_ns = known[record.channel_id], record.log_time
            if time_ns < last_ns - _NS:  # a second: the writer holds back less
                raise FileError(
                    self.path,
                    f"its messages are not in the order of time (topic {topic}); `mcap sort` puts "
                    "them in order",
                )
            last_ns = max(last_ns, time_ns)
            if topics is not None and topic not in topics:
                continue
            if time_ns >= start_ns and (end_ns is None or time_ns < end_ns):
                yield StoredMessage(topic=topic, time_ns=time_ns, data=record.data)

    def _chunks(
        self, topics: Collection[str] | None, start_ns: int, end_ns: int | None
    ) -> tuple[list[Any] | None, dict[int, str]]:
        """Return the chunks that may have such messages, and the topics of their channels."""
        if self._summary is None or not self._summary.chunk_indexes:
            return None, {}  # the whole file is read
        known = {number: channel.topic for number, channel in self._summary.channels.items()}
        chunks = [
            chunk
            for chunk in self._summary.chunk_indexes
            if chunk.message_end_time >= start_ns
            and (end_ns is None or chunk.message_start_time < end_ns)
            and (topics is None or {known[one] for one in chunk.message_index_offsets} & {*topics})
        ]
        return chunks, known

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
        # A tick's messages have one time; a tool that sorts by time may change their order.
        found: dict[str, bytes] = {}
        time_ns = None
        statuses = self._statuses_before(from_s)
        for message in self.messages(from_s=from_s, to_s=to_s):
            again = message.topic == channels.TICK.topic and message.topic in found
            if message.time_ns != time_ns or again:
                if channels.TICK.topic in found:
                    moment = self._moment(found, statuses)
                    statuses = moment.statuses
                    yield moment
                elif channels.TREE_STATUS.topic in found:  # the statuses at the start of a part
                    statuses = self._statuses(found[channels.TREE_STATUS.topic])
                found, time_ns = {}, message.time_ns
            found[message.topic] = message.data
        if found.keys() >= _NEEDED:
            yield self._moment(found, statuses)

    def _statuses_before(self, from_s: float | None) -> tuple[str, ...]:
        """Return the statuses before a time; statuses are recorded when they change."""
        last = None
        if from_s is not None and from_s > 0.0:
            for last in self.messages([channels.TREE_STATUS.topic], to_s=from_s):  # noqa: B007
                pass
        if last is None:
            return ("IDLE",) * len(self.tree.nodes)
        return self._statuses(last.data)

    def _moment(self, found: Mapping[str, bytes], statuses: tuple[str, ...]) -> Moment:
        try:
            return moment_of(found, statuses, self.classes)
        except (InputError, ArithmeticError, TypeError, ValueError) as error:
            raise self._damaged("tick", error) from error

    def _statuses(self, data: bytes) -> tuple[str, ...]:
        try:
            return decode(StatusNote, parse_json(data)).statuses
        except InputError as error:
            raise self._damaged("tick", error) from error

    def _damaged(self, what: str, error: Exception) -> FileError:
        return FileError(self.path, f"the record's {what} is damaged: {error}")


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
    try:
        for message in reader.messages((*_DECODED, channels.CAMERA_IMAGE.topic)):
            if message.topic != channels.CAMERA_IMAGE.topic:
                found = decode(_DECODED[message.topic], parse_json(message.data))
                if isinstance(found, FrameNote):
                    note = found
                else:
                    yield found
            elif note is not None:
                yield StoredFrame(note=note, image=image_bytes(message.data))
                note = None
    except FileError:
        raise
    except InputError as error:
        raise FileError(reader.path, f"a message of the record is damaged: {error}") from error
    if reader.damages:
        raise FileError(
            reader.path, f"is damaged ({reader.damages[0]}); `mcap recover` saves the intact part"
        )
