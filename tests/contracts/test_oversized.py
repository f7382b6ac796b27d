"""Files that claim or grow to gigabytes are refused before they fill the memory."""

from __future__ import annotations

import tracemalloc
import zlib

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.records import Chunk

from uav_bt.errors import InputError, ValueRangeError
from uav_bt.record.channels import NodeNote, TickNote, TreeNote
from uav_bt.record.images import decode_image, encode_image
from uav_bt.record.scan import opened


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
