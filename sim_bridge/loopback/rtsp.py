"""RTSP as text: requests, answers, offers of transport, and the SDP (RFC 2326, RFC 8866)."""

from __future__ import annotations

import asyncio
import base64
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from sim_bridge.loopback.encoder import CLOCK_HZ
from sim_bridge.loopback.rtp import PAYLOAD_TYPE

CONTROL: Final = "stream=0"  # last part of the URL of the medium

_VERSION: Final = "RTSP/1.0"
_MAX_PORT: Final = 65_535
_MAX_CHANNEL: Final = 255
_REASONS: Final[Mapping[int, str]] = {
    200: "OK",
    400: "Bad Request",
    404: "Not Found",
    451: "Parameter Not Understood",
    454: "Session Not Found",
    461: "Unsupported Transport",
    500: "Internal Server Error",
    501: "Not Implemented",
}


class RtspError(Exception):
    """A refused request.

    Args:
        status: status of the answer.
        why: reason, as a sentence for the user.
    """

    def __init__(self, status: int, why: str) -> None:
        super().__init__(why)
        self.status = status


@dataclass(frozen=True, kw_only=True)
class Request:
    """One request; its body is not read."""

    method: str
    url: str
    headers: Mapping[str, str]  # names in lower case


async def read_request(reader: asyncio.StreamReader) -> Request:
    """Return the next request; packets between requests (section 10.12) are skipped.

    Raises:
        RtspError: the bytes are not RTSP; the rest cannot be read either.
        asyncio.IncompleteReadError: the connection has ended.
    """
    while (first := await reader.readexactly(1)) in b"$\r\n":
        if first == b"$":
            _, size = await reader.readexactly(1), await reader.readexactly(2)
            await reader.readexactly(int.from_bytes(size, "big"))
    try:
        head = first + await reader.readuntil(b"\r\n\r\n")
    except asyncio.LimitOverrunError as error:
        raise RtspError(400, "the request is too long") from error
    lines = head.decode("latin-1").rstrip().split("\r\n")
    words = lines[0].split(" ")
    if len(words) != 3 or words[2] != _VERSION:
        raise RtspError(400, f"expected 'METHOD URL {_VERSION}' in the first line")
    pairs = (line.partition(":") for line in lines[1:])
    headers = {name.strip().lower(): value.strip() for name, _, value in pairs}
    if headers.get("content-length", "0") != "0":
        raise RtspError(451, "expected a request without a body")
    return Request(method=words[0], url=words[1], headers=headers)


def answer(
    status: int, sequence: str, headers: Mapping[str, str] | None = None, body: str = ""
) -> bytes:
    """Return an answer.

    Args:
        status: status of the answer.
        sequence: number of the request; empty if unknown.
        headers: headers in addition to those of all answers.
        body: body of the answer.
    """
    lines = [f"{_VERSION} {status} {_REASONS[status]}", "Server: uav_bt"]
    lines += [f"CSeq: {sequence}"] if sequence else []
    lines += [f"{name}: {value}" for name, value in (headers or {}).items()]
    lines += [f"Content-Length: {len(body.encode())}"] if body else []
    return "\r\n".join([*lines, "", body]).encode()


def refusal(error: RtspError, sequence: str = "") -> bytes:
    """Return the answer to a refused request."""
    return answer(error.status, sequence, {"Content-Type": "text/plain"}, f"{error}\n")


def choose_transport(header: str) -> tuple[bool, tuple[int, int]]:
    """Return the first offered transport that is supported.

    Returns:
        Whether packets go through the RTSP connection; its channels for RTP and RTCP, or otherwise
        the client's UDP ports for them.

    Raises:
        RtspError: no offered transport is supported.
    """
    for offer in header.split(","):
        profile, *parameters = (part.strip() for part in offer.split(";"))
        tcp = profile.upper() == "RTP/AVP/TCP"
        if not tcp and profile.upper() not in {"RTP/AVP", "RTP/AVP/UDP"}:
            continue
        name, largest = ("interleaved", _MAX_CHANNEL) if tcp else ("client_port", _MAX_PORT)
        for parameter in parameters:
            found = re.fullmatch(rf"{name}=(\d{{1,5}})-(\d{{1,5}})", parameter)
            if found is not None and max(int(found[1]), int(found[2])) <= largest:
                return tcp, (int(found[1]), int(found[2]))
    raise RtspError(
        461,
        "expected 'RTP/AVP;unicast;client_port=A-B' or 'RTP/AVP/TCP;unicast;interleaved=A-B'",
    )


def describe(
    sets: tuple[bytes, bytes], *, serial: str, host: str, session: int, media_name: str
) -> str:
    """Return the SDP, which describes the stream to a client before the setup.

    Sources: RFC 8866 (SDP), RFC 6184 section 8.2 (H.264), Parrot's libsdp and
    libvideo-metadata. Olympe 8.5.0 finds the medium by its `i=` line. A session-wide
    `a=range:npt=now-` is an error for that parser, so it is omitted.

    Args:
        sets: the parameter sets of the H.264 stream.
        serial: serial number of the drone; Olympe shows it as metadata of the session.
        host: numeric IPv4 address of the server.
        session: number of this session.
        media_name: name of the stream.
    """
    sprop = ",".join(base64.b64encode(unit).decode() for unit in sets)
    parameters = (
        "packetization-mode=1",
        f"profile-level-id={sets[0][1:4].hex().upper()}",
        f"sprop-parameter-sets={sprop}",
    )
    lines = (
        "v=0",
        f"o=- {session} 1 IN IP4 {host}",
        "s=ANAFI",
        "i=ANAFI",
        f"c=IN IP4 {host}",
        "t=0 0",
        "a=tool:uav_bt",
        "a=control:*",
        "a=X-com-parrot-maker:Parrot",
        "a=X-com-parrot-model:ANAFI",
        "a=X-com-parrot-model-id:0914",
        f"a=X-com-parrot-serial:{serial}",
        f"m=video 0 RTP/AVP {PAYLOAD_TYPE}",
        f"i={media_name}",
        f"a=rtpmap:{PAYLOAD_TYPE} H264/{CLOCK_HZ}",
        f"a=fmtp:{PAYLOAD_TYPE} {';'.join(parameters)}",
        f"a=control:{CONTROL}",
        "a=X-com-parrot-default-media:1",
        "a=X-com-parrot-camera-type:front",
        "a=X-com-parrot-camera-spectrum:visible",
    )
    return "".join(f"{line}\r\n" for line in lines)
