"""Reads records: whole ones, unfinished ones, and the intact parts of damaged ones.

reader = RecordReader(Path("flight.mcap"))
for moment in reader.moments():
    print(moment.tick.time_s, moment.commands.sent)
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, Final

from uav_bt.errors import FileError, InputError
from uav_bt.files import parse_json
from uav_bt.lab.classes import LabClass, LabClasses
from uav_bt.plugins import need
from uav_bt.record import channels
from uav_bt.record.channels import END, SCHEMA_VERSION, START, StatusNote, TreeNote
from uav_bt.record.moment import Moment, moment_of
from uav_bt.record.record_file import Attachment, Timeline
from uav_bt.record.values import decode
from uav_bt.types import CameraModel

_NS: Final = 1_000_000_000


@dataclass(frozen=True, kw_only=True)
class StoredMessage:
    """A message of the file, not decoded."""

    topic: str
    time_ns: int  # on the record's timeline
    data: bytes


class RecordReader:
    """One record. Opening reads its beginning, and an index that other tools moved to the end.

    Args:
        path: the file.

    Attributes:
        metadata: facts written at the start of the flight.
        attachments: attached files by name: the tree's files, the scene.
        timeline: converts mission seconds and record times.
        camera: camera of the drone.
        tree: the nodes, in the order of the statuses in the moments.
        finished: whether the record was closed. An unfinished one lacks index, summary and `end`.
        damages: the damage that the last pass found.

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
            self.classes = self._lab_classes()
        except (KeyError, ValueError, OverflowError, InputError) as error:
            raise self._damaged("metadata", error) from error

    @property
    def damages(self) -> tuple[str, ...]:
        """The damage that the last pass found, one line each."""
        return tuple(str(damage) for damage in self._scan.damages)

    def _read_beginning(self) -> None:
        from mcap.records import Attachment as Attached  # noqa: PLC0415 - an extra
        from mcap.records import Channel, Message, Metadata  # noqa: PLC0415

        topics: dict[int, str] = {}
        first_ns = None
        for record in self._scan:
            if isinstance(record, Metadata) and record.name == START:
                self.metadata = dict(record.metadata)
            elif isinstance(record, Attached):
                self.attachments[record.name] = Attachment(
                    name=record.name, media_type=record.media_type, data=record.data
                )
            elif isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message):
                first_ns = record.log_time if first_ns is None else first_ns
                if record.log_time > first_ns:  # the tree is among the first messages
                    break
                if topics[record.channel_id] == channels.TREE.topic:
                    self.tree = decode(TreeNote, parse_json(record.data))
        if self.finished:
            self._read_moved()

    def _read_moved(self) -> None:
        """Take metadata and attachments that stand behind the messages, as MCAP allows."""
        with self.path.open("rb") as stream:
            try:
                indexed = self._indexed(stream)
                summary = indexed.get_summary()
                if START not in {index.name for index in summary.metadata_indexes}:
                    return
                names = {index.name for index in summary.attachment_indexes}
                if self.metadata and names <= self.attachments.keys():
                    return
                found = {record.name: record for record in indexed.iter_metadata()}
                attached = list(indexed.iter_attachments())
            except Exception:  # noqa: BLE001 - a damaged index: what stands at the beginning counts
                return
        self.metadata = dict(found[START].metadata)
        for record in attached:
            self.attachments[record.name] = Attachment(
                name=record.name, media_type=record.media_type, data=record.data
            )

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

    @property
    def end(self) -> Mapping[str, str] | None:
        """End of the flight and losses of the record; None if it was not closed."""
        if not self.finished:
            return None
        from mcap.records import Metadata  # noqa: PLC0415 - an extra

        with self.path.open("rb") as stream:
            try:
                records: Iterable[Any] = list(self._indexed(stream).iter_metadata())
            except Exception:  # noqa: BLE001 - a damaged index raises anything in the parser
                records = self._scan  # slower, but needs no index
            for record in records:
                if isinstance(record, Metadata) and record.name == END:
                    return dict(record.metadata)
        return None

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
        start_ns = 0 if from_s is None else self.timeline.start_ns + round(from_s * _NS)
        end_ns = None if to_s is None else self.timeline.start_ns + round(to_s * _NS)
        wanted = None if topics is None else frozenset(topics)
        if self.finished and (from_s is not None or to_s is not None):
            found = self._found_by_index(wanted, start_ns, end_ns)
        else:
            found = self._found_by_scan()
        for message in found:
            if wanted is not None and message.topic not in wanted:
                continue
            if message.time_ns >= start_ns and (end_ns is None or message.time_ns < end_ns):
                yield message

    def _found_by_scan(self) -> Iterator[StoredMessage]:
        from mcap.records import Channel, Message  # noqa: PLC0415 - an extra

        topics: dict[int, str] = {}
        last_ns = 0
        for record in self._scan:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message):
                if record.log_time < last_ns - _NS:  # a second: the writer holds back less
                    raise FileError(
                        self.path,
                        f"its messages are not in the order of time (topic "
                        f"{topics[record.channel_id]}); `mcap sort` puts them in order",
                    )
                last_ns = max(last_ns, record.log_time)
                yield StoredMessage(
                    topic=topics[record.channel_id], time_ns=record.log_time, data=record.data
                )

    def _found_by_index(
        self, topics: Collection[str] | None, start_ns: int, end_ns: int | None
    ) -> Iterator[StoredMessage]:
        from mcap.records import Message  # noqa: PLC0415 - an extra

        from uav_bt.record.scan import indexed_chunks  # noqa: PLC0415 - an extra

        with self.path.open("rb") as stream:
            try:
                summary = self._indexed(stream).get_summary()
                if not summary.chunk_indexes:  # without chunks: the whole file is read
                    yield from self._found_by_scan()
                    return
                chunks = _matching(summary, topics, start_ns, end_ns)
                for record in chain.from_iterable(indexed_chunks(stream, chunks)):
                    if isinstance(record, Message):
                        topic = summary.channels[record.channel_id].topic
                        yield StoredMessage(topic=topic, time_ns=record.log_time, data=record.data)
            except Exception as error:  # a damaged file can raise anything in the parser
                raise FileError(
                    self.path, f"is damaged ({error}); `mcap recover` saves the intact part"
                ) from error

    @staticmethod
    def _indexed(stream: Any) -> Any:
        from mcap.reader import SeekingReader  # noqa: PLC0415 - an extra

        return SeekingReader(stream, validate_crcs=True)

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
        if {channels.TICK.topic, channels.STATE.topic, channels.COMMANDS.topic} <= found.keys():
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

    def _lab_classes(self) -> LabClasses:
        return LabClasses(decode(LabClass, each) for each in parse_json(self.metadata["classes"]))

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


def _matching(
    summary: Any, topics: Collection[str] | None, start_ns: int, end_ns: int | None
) -> Iterator[Any]:
    """Yield the indices of the chunks that may have matching messages."""
    for chunk in summary.chunk_indexes:
        names = {summary.channels[channel].topic for channel in chunk.message_index_offsets}
        if (
            chunk.message_end_time >= start_ns
            and (end_ns is None or chunk.message_start_time < end_ns)
            and (topics is None or not names.isdisjoint(topics))
        ):
            yield chunk
