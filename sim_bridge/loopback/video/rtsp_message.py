"""RTSP requests and answers as bytes (RFC 2326), with packets in between.

The reader accepts bytes in pieces and uses no sockets. It refuses data at once if they are not RTSP
or larger than a valid request.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

MAX_HEAD_BYTES: Final = 8192
MAX_BODY_BYTES: Final = 8192

_VERSION: Final = "RTSP/1.0"
_MAX_HEADERS: Final = 64
_TOKEN: Final = re.compile(r"[!#$%&'*+\-.^_`|~0-9A-Za-z]{1,64}")
_URL: Final = re.compile(r"[\x21-\x7e]{1,1024}")
_METHOD: Final = re.compile(r"[A-Z_]{1,32}")
_END_OF_HEAD: Final = re.compile(rb"\r?\n\r?\n")
_DOLLAR: Final = 0x24  # first byte of an interleaved packet
_REASONS: Final[Mapping[int, str]] = {
    200: "OK",
    400: "Bad Request",
    404: "Not Found",
    405: "Method Not Allowed",
    406: "Not Acceptable",
    413: "Request Entity Too Large",
    451: "Parameter Not Understood",
    453: "Not Enough Bandwidth",
    454: "Session Not Found",
    455: "Method Not Valid in This State",
    461: "Unsupported Transport",
    500: "Internal Server Error",
    501: "Not Implemented",
    505: "RTSP Version Not Supported",
    551: "Option not supported",
}


class RtspError(Exception):
    """A refused request.

    Args:
        status: status of the answer.
        why: reason, as a sentence for the user.
        headers: additional headers of the answer.
    """

    def __init__(self, status: int, why: str, *, headers: Mapping[str, str] | None = None) -> None:
        super().__init__(why)
        self.status = status
        self.why = why
        self.headers = dict(headers or {})


@dataclass(frozen=True, kw_only=True)
class Request:
    """One request."""

    method: str
    url: str
    headers: Mapping[str, str] = field(default_factory=dict)  # names in lower case
    body: bytes = b""

    @property
    def sequence(self) -> str:
        """The number that links the answer to the request; empty without one."""
        number = self.headers.get("cseq", "")
        return number if number.isascii() and number.isdigit() and len(number) <= 10 else ""


class RequestReader:
    """Extracts requests from the bytes of one connection.

    Packets between them (RTCP reports; RFC 2326, section 10.12) are skipped.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> Iterator[Request]:
        """Add bytes and yield the requests that are now complete.

        Raises:
            RtspError: the data is not RTSP or too large; the rest cannot be read either.
        """
        self._buffer += data
        while self._skip_blank_lines():
            if self._buffer[0] == _DOLLAR:
                end = 4 + int.from_bytes(self._buffer[2:4], "big")
                if len(self._buffer) < max(4, end):
                    return
                del self._buffer[:end]
            elif (request := self._request()) is not None:
                yield request
            else:
                return

    def _skip_blank_lines(self) -> bool:
        skipped = len(self._buffer) - len(self._buffer.lstrip(b"\r\n"))
        del self._buffer[:skipped]
        return bool(self._buffer)

    def _request(self) -> Request | None:
        blank = _END_OF_HEAD.search(self._buffer, 0, MAX_HEAD_BYTES + 4)
        if blank is None:
            if len(self._buffer) > MAX_HEAD_BYTES:
                raise RtspError(413, f"a request has at most {MAX_HEAD_BYTES} bytes")
            self._refuse_early()
            return None
        head = _parse_head(bytes(self._buffer[: blank.start()]))
        length = _content_length(head)
        if len(self._buffer) < blank.end() + length:
            return None
        body = bytes(self._buffer[blank.end() : blank.end() + length])
        del self._buffer[: blank.end() + length]
        return Request(method=head.method, url=head.url, headers=head.headers, body=body)

    def _refuse_early(self) -> None:
        start = bytes(self._buffer[:33])
        method = start.partition(b" ")[0]
        if start and (
            (len(method) > 32) or not re.fullmatch(rb"[A-Z_]+", method.partition(b"\r")[0])
        ):
            raise RtspError(400, "this is not an RTSP request")


def answer(
    status: int, sequence: str, headers: Mapping[str, str] | None = None, body: bytes = b""
) -> bytes:
    """Return an answer.

    Args:
        status: status of the answer.
        sequence: number of the request.
        headers: headers in addition to those of all answers.
        body: body of the answer.
    """
    lines = [f"{_VERSION} {status} {_REASONS[status]}"]
    if sequence:
        lines.append(f"CSeq: {sequence}")
    lines.append("Server: uav_bt")
    lines += [f"{name}: {value}" for name, value in (headers or {}).items()]
    if body:
        lines.append(f"Content-Length: {len(body)}")
    return "\r\n".join([*lines, "", ""]).encode() + body


def _parse_head(head: bytes) -> Request:
    try:
        lines = head.decode("utf-8").replace("\r\n", "\n").split("\n")
    except UnicodeDecodeError as error:
        raise RtspError(400, "a request's head is UTF-8") from error
    words = lines[0].split(" ")
    if len(words) != 3 or not _METHOD.fullmatch(words[0]) or not words[2].startswith("RTSP/"):
        raise RtspError(400, "expected 'METHOD URL RTSP/1.0' in the first line")
    if not _URL.fullmatch(words[1]):
        raise RtspError(400, "a URL has 1 to 1024 printable ASCII characters")
    if words[2] != _VERSION:
        raise RtspError(505, f"expected {_VERSION}")
    if len(lines) - 1 > _MAX_HEADERS:
        raise RtspError(400, f"a request has at most {_MAX_HEADERS} headers")
    headers: dict[str, str] = {}
    for line in lines[1:]:
        name, colon, value = line.partition(":")
        if not colon or not _TOKEN.fullmatch(name.strip()):
            raise RtspError(400, "expected 'Name: value' in every header")
        headers[name.strip().lower()] = value.strip()
    return Request(method=words[0], url=words[1], headers=headers)


def _content_length(head: Request) -> int:
    text = head.headers.get("content-length", "0")
    if not text.isascii() or not text.isdigit() or len(text) > 9:
        raise RtspError(400, "Content-Length is a number of bytes")
    if int(text) > MAX_BODY_BYTES:
        raise RtspError(413, f"a body has at most {MAX_BODY_BYTES} bytes")
    return int(text)
