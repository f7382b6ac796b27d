"""RTSP messages as bytes."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_bridge.loopback.video.rtsp_message import (
    MAX_BODY_BYTES,
    MAX_HEAD_BYTES,
    Request,
    RequestReader,
    RtspError,
    answer,
)
from tests.sim_bridge.loopback.video.video_client import parse_answer

OPTIONS = b"OPTIONS rtsp://127.0.0.1/live RTSP/1.0\r\nCSeq: 1\r\n\r\n"
PARAMETER = (
    b"GET_PARAMETER rtsp://127.0.0.1/live RTSP/1.0\r\nCSeq: 2\r\nContent-Length: 4\r\n\r\nrate"
)
PACKET = b"$\x01\x00\x03abc"


def read(*chunks: bytes) -> list[Request]:
    reader = RequestReader()
    return [message for chunk in chunks for message in reader.feed(chunk)]


def refused(data: bytes) -> RtspError:
    with pytest.raises(RtspError) as caught:
        read(data)
    return caught.value


@given(st.lists(st.integers(0, len(OPTIONS + PACKET + PARAMETER)), max_size=12))
def test_messages_are_the_same_however_their_bytes_arrive(cuts: list[int]) -> None:
    data = OPTIONS + PACKET + PARAMETER
    ends = [*sorted(cuts), len(data)]
    chunks = [data[a:b] for a, b in zip([0, *ends], ends, strict=False)]
    assert read(*chunks) == read(data)
    options, parameter = read(data)
    assert (options.method, options.sequence, options.body) == ("OPTIONS", "1", b"")
    assert (parameter.headers["content-length"], parameter.body) == ("4", b"rate")


def test_plain_newlines_and_blank_lines_between_requests_are_taken() -> None:
    (request,) = read(b"\r\n\n" + OPTIONS.replace(b"\r\n", b"\n"))
    assert request.url == "rtsp://127.0.0.1/live"


@given(st.binary(max_size=300))
def test_any_bytes_are_read_or_refused(data: bytes) -> None:
    reader = RequestReader()
    with contextlib.suppress(RtspError):
        for message in reader.feed(data):
            assert isinstance(message, Request)


@pytest.mark.parametrize(
    ("data", "status"),
    [
        (b"GET / HTTP/1.1\r\nHost: x\r\n\r\n", 400),
        (b"OPTIONS rtsp://x/live\r\n\r\n", 400),
        (b"OPTIONS rtsp://x/live RTSP/2.0\r\nCSeq: 1\r\n\r\n", 505),
        (b"OPTIONS rtsp://x/live RTSP/1.0\r\nno colon\r\n\r\n", 400),
        (b"OPTIONS rtsp://x/li\xffve RTSP/1.0\r\n\r\n", 400),
        (b"OPTIONS rtsp://x/li\rve RTSP/1.0\r\n\r\n", 400),
        (b"OPTIONS * RTSP/1.0\r\nContent-Length: -1\r\n\r\n", 400),
        (b"OPTIONS * RTSP/1.0\r\nContent-Length: 99999\r\n\r\n", 413),
        (b"OPTIONS * RTSP/1.0\r\nContent-Length: 9999999999999\r\n\r\n", 400),
        (b"OPTIONS * RTSP/1.0\r\n" + b"A: b\r\n" * 65 + b"\r\n", 400),
        (b"\x16\x03\x01\x02\x00\x01", 400),  # a TLS greeting, refused before its end
        (b"options * RTSP/1.0", 400),  # refused before its end
        (b"A" * 40, 400),  # refused before its end
    ],
)
def test_what_is_no_request_is_refused(data: bytes, status: int) -> None:
    assert refused(data).status == status


def test_a_request_that_does_not_end_is_refused() -> None:
    reader = RequestReader()
    assert (
        list(reader.feed(b"OPTIONS * RTSP/1.0\r\n" + b"A: " + b"b" * (MAX_HEAD_BYTES - 40))) == []
    )
    with pytest.raises(RtspError, match=f"at most {MAX_HEAD_BYTES} bytes") as caught:
        list(reader.feed(b"b" * 100))
    assert caught.value.status == 413


def test_a_body_of_the_largest_size_is_taken() -> None:
    head = f"GET_PARAMETER * RTSP/1.0\r\nContent-Length: {MAX_BODY_BYTES}\r\n\r\n".encode()
    (request,) = read(head + bytes(MAX_BODY_BYTES))
    assert len(request.body) == MAX_BODY_BYTES


@pytest.mark.parametrize("number", ["", "x", "-1", "1" * 11, "\u0663"])
def test_a_sequence_that_is_no_number_is_none(number: str) -> None:
    assert Request(method="OPTIONS", url="*", headers={"cseq": number}).sequence == ""


def test_an_answer_says_how_long_its_body_is() -> None:
    found = parse_answer(answer(200, "7", {"Session": "A"}, b"v=0\r\n"))
    assert (found.status, found.headers["cseq"], found.headers["session"]) == (200, "7", "A")
    assert found.body == b"v=0\r\n"
