"""Each reader of a file accepts the file, or refuses it with one of our errors that names it."""

from __future__ import annotations

import json
import re
import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Final

import lz4.frame
import numpy as np
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.records import Chunk

from tests.contracts.intact_files import BINARIES, READERS, TEXTS, Reader
from tests.worlds.records import copy_part
from uav_bt.errors import InputError, TreeError, ValueRangeError
from uav_bt.record.channels import CHANNELS, START, NodeNote, TickNote, TreeNote
from uav_bt.record.images import decode_image, encode_image
from uav_bt.record.reader import RecordReader
from uav_bt.record.record_file import RecordFile
from uav_bt.record.scan import opened

CURES: Final = {
    "teacher": "`uav-bt lab train`",
    "U-Net": "`uav-bt lab train`",
    "depth network": "`uav-bt net train depth`",
    "weights": "`uav-bt net train student`",
    "student": "`uav-bt net train student`",
    "labels": "delete the file to have it made anew",
    "views": "delete it",
}
"""What to do without the file, in the text of its refusal."""


def refusal(reader: Reader, path: Path) -> list[str]:
    """Return the lines of the reader's error; none if it reads the file."""
    try:
        reader.read(path)
    except InputError as error:
        lines = str(error).split("\n")
        return lines[1:] if isinstance(error, TreeError) else lines  # its first line has the count
    return []


def refused(reader: Reader, path: Path) -> bool:
    """Return whether the reader refuses the file; each line of the refusal names it."""
    lines = refusal(reader, path)
    assert all(path.name in line for line in lines), lines
    return bool(lines)


@pytest.mark.parametrize("kind", READERS)
def test_an_intact_file_is_read(kind: str, tmp_path: Path) -> None:
    """Otherwise the damage would not be the reason of a refusal."""
    reader = READERS[kind]
    reader.read(reader.write(tmp_path))


def absent(path: Path) -> None:
    path.unlink()


def folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def empty(path: Path) -> None:
    path.write_bytes(b"")


def noise(path: Path) -> None:
    path.write_bytes(np.random.default_rng(0).bytes(5000))


@pytest.mark.parametrize("damage", [absent, folder, empty, noise], ids=lambda one: one.__name__)
@pytest.mark.parametrize("kind", READERS)
def test_what_is_no_such_file_is_refused(
    kind: str, damage: Callable[[Path], None], tmp_path: Path
) -> None:
    reader = READERS[kind]
    path = reader.write(tmp_path)
    damage(path)
    assert refused(reader, path) is (damage.__name__ not in reader.fits)
    if damage is absent:
        assert CURES.get(kind, "") in " ".join(refusal(reader, path))


@pytest.mark.parametrize("kind", BINARIES)
def test_a_damaged_file_is_read_or_refused(kind: str, tmp_path: Path) -> None:
    reader, rng = READERS[kind], np.random.default_rng(1)
    path = reader.write(tmp_path)
    data = path.read_bytes()
    for share in (0.1, 0.6, 0.999):
        path.write_bytes(data[: round(share * len(data))])
        refused(reader, path)
    for _ in range(3):
        flipped = np.frombuffer(data, np.uint8).copy()
        flipped[rng.integers(len(data), size=10)] ^= rng.integers(1, 256, 10, np.uint8)
        path.write_bytes(flipped.tobytes())
        refused(reader, path)


# --- texts that were edited -----------------------------------------------------------------------

WORDS: Final = b"\0 -1 1e999 nan null [] {} '' *a &a !!int <!-- x".split()
LONG: Final = (b"", b"9" * 5000, b"[" * 500, b"<a>" * 200)
DAMAGE: Final = st.binary(max_size=8) | st.sampled_from([*WORDS, *LONG])
# A position as a share of the file's length, the bytes removed there, and the bytes inserted.
Edit = tuple[float, int, bytes]
EDITS: Final = st.lists(st.tuples(st.floats(0, 1), st.integers(0, 40), DAMAGE), min_size=1)
VALUES: Final = st.sampled_from([None, True, -1, 2**63, 1e308, "", "x" * 10_000, [], [None], {}])
# The same damage in every run.
SAME: Final = settings(
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)


def edited(data: bytes, edits: list[Edit]) -> bytes:
    for share, dropped, put in edits:
        at = round(share * len(data))
        data = data[:at] + put + data[at + dropped :]
    return data


def with_wrong_value(whole: bytes, seed: int, value: object) -> bytes:
    """Return JSON with one value, at any depth, replaced."""
    content, rng = json.loads(whole), np.random.default_rng(seed)
    inner = content
    while True:
        keys = list(inner) if isinstance(inner, dict) else range(len(inner))
        key = keys[rng.integers(len(keys))]
        if not (inner[key] and isinstance(inner[key], (dict, list)) and rng.random() < 0.7):
            inner[key] = value
            return json.dumps(content).encode() + b"\n"
        inner = inner[key]


@pytest.mark.parametrize("kind", [*TEXTS, "record"])
@given(edits=EDITS)
@settings(SAME, max_examples=25)
def test_an_edited_file_is_read_or_refused(kind: str, tmp_path: Path, edits: list[Edit]) -> None:
    path = READERS[kind].write(tmp_path)
    path.write_bytes(edited(path.read_bytes(), edits))
    refused(READERS[kind], path)


@pytest.mark.parametrize("kind", ["flights", "campaign"])
@given(seed=st.integers(0, 2**32), value=VALUES)
@settings(SAME, max_examples=60)
def test_whole_json_with_wrong_values_is_read_or_refused(
    kind: str, tmp_path: Path, seed: int, value: object
) -> None:
    path = READERS[kind].write(tmp_path)
    path.write_bytes(with_wrong_value(path.read_bytes(), seed, value))
    refused(READERS[kind], path)


@given(topic=st.sampled_from(sorted(CHANNELS)), seed=st.integers(0, 2**32), value=VALUES)
@settings(SAME, max_examples=25)
def test_whole_records_with_wrong_messages_are_read_or_refused(
    tmp_path: Path, topic: str, seed: int, value: object
) -> None:
    """The checksums are right, and the first JSON message of a channel has a wrong value."""
    whole = READERS["record"].write(tmp_path)
    path, reader, changed = tmp_path / "damaged.mcap", RecordReader(whole), False
    file = RecordFile(path)
    file.metadata(START, reader.metadata)
    for name, time_ns, whole_data in reader.messages(to_s=2.0):
        data = whole_data
        if name == topic and data[:1] == b"{" and not changed:
            data, changed = with_wrong_value(data, seed, value), True
        file.write(CHANNELS[name], time_ns, data)
    file.finish()
    refused(READERS["record"], path)


# --- files of a later version ---------------------------------------------------------------------

NINTH: Final = {
    "tree": (b'format="4"', b'format="9"'),
    "lab": (b"version: 1", b"version: 9"),
    "campaign": (b'"format": 1', b'"format": 9'),
    "weights": (b'\\"version\\": 2', b'\\"version\\": 9'),
    "student": (b'"version": 2', b'"version": 9'),
}
"""Of each kind with a version: its text in the file, and that of version 9."""


@pytest.mark.parametrize("kind", [*NINTH, "record"])
def test_a_file_of_a_later_version_is_refused_with_that_version(kind: str, tmp_path: Path) -> None:
    reader = READERS[kind]
    path = reader.write(tmp_path)
    if kind == "record":
        later = path.with_name("later.mcap")
        copy_part(path, later, metadata={START: {"schema_version": "9"}}).replace(path)
    else:
        now, ninth = NINTH[kind]
        assert now in path.read_bytes()
        path.write_bytes(path.read_bytes().replace(now, ninth, 1))
    assert refused(reader, path)
    assert re.search(r"(version|format).*\b9\b", " ".join(refusal(reader, path)))


# --- files that claim or grow to gigabytes --------------------------------------------------------


def chunk_of(data: bytes, compression: str, claimed_bytes: int) -> Chunk:
    pack = {"zstd": zstandard.compress, "lz4": lz4.frame.compress, "": bytes, "brotli": bytes}
    return Chunk(
        compression=compression,
        data=pack[compression](data),
        message_start_time=0,
        message_end_time=0,
        uncompressed_crc=0,
        uncompressed_size=claimed_bytes,
    )


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_that_grows_to_gigabytes_is_not_opened(compression: str) -> None:
    """A true size is refused at once, a false one as soon as the data exceed it."""
    zeros = bytes(200_000_000)
    with pytest.raises(ValueError, match="a chunk of 200000000 bytes, opened, more than 33554432"):
        opened(chunk_of(zeros, compression, len(zeros)))
    liar = chunk_of(zeros, compression, 1000)
    tracemalloc.start()
    with pytest.raises(ValueError, match="a chunk of 1000 bytes has 1001 or more"):
        opened(liar)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2_000_000
    with pytest.raises(ValueError, match="compressed by 'brotli'"):
        opened(chunk_of(b"", "brotli", 0))


def test_an_image_of_billions_of_pixels_is_not_decoded() -> None:
    data = bytearray(encode_image(np.zeros((4, 4, 3), dtype=np.uint8), "lossless")[0])
    data[16:24] = 2 * (46_000).to_bytes(4)
    data[29:33] = zlib.crc32(data[12:29]).to_bytes(4)
    with pytest.raises(InputError, match="46000x46000 has more than 50000000 pixels"):
        decode_image(bytes(data))


def test_times_and_parents_that_no_view_can_show_are_refused() -> None:
    for index, time_s in ((0, 1e12), (0, float("nan")), (-1, 1.0)):
        with pytest.raises(ValueRangeError, match=f"tick {index} at .* s is none"):
            TickNote(index=index, time_s=time_s, tree_status="RUNNING")
    with pytest.raises(ValueRangeError, match="node 0 must come after its parent, 0"):
        TreeNote(nodes=(NodeNote(path="Main", name="Main", node_id="Sequence", parent=0),))
