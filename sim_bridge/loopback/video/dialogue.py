"""RTSP session of one client: answers to requests, without sockets.

Source: RFC 2326, sections 10 and 11 and appendix A (the states of a session).
"""

from __future__ import annotations

import base64
import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from random import Random
from typing import Final, Protocol
from urllib.parse import urlsplit

from sim_bridge.loopback.video.encoder import CLOCK_HZ, ParameterSets
from sim_bridge.loopback.video.rtp import PAYLOAD_TYPE
from sim_bridge.loopback.video.rtsp_message import Request, RtspError, answer
from sim_bridge.loopback.video.transport import Transport, choose_transport

_PATH: Final = "live"
DIRECT_MEDIUM: Final = "Front camera"  # name of the video over the drone's Wi-Fi
REMOTE_MEDIUM: Final = "DefaultVideo"  # name of the video through a remote control, as reported
_CONTROL: Final = "stream=0"

_METHODS: Final = "OPTIONS, DESCRIBE, SETUP, PLAY, PAUSE, GET_PARAMETER, TEARDOWN"
# Methods of the RFC that do not apply to a server of live video.
_NOT_ALLOWED: Final = frozenset({"ANNOUNCE", "RECORD", "REDIRECT", "SET_PARAMETER"})


class SessionActions(Protocol):
    """Actions that requests of a client trigger."""

    def description(self) -> str:
        """Return the SDP."""

    def set_up(self, transport: Transport) -> str:
        """Prepare a stream, replacing an earlier one; return the `Transport` header of the answer.

        Raises:
            RtspError: there are too many streams.
        """

    def play(self) -> tuple[int, int]:
        """Start sending; return the sequence number of the next packet and the present timestamp.

        Raises:
            RtspError: the video has ended.
        """

    def pause(self) -> None:
        """Stop sending."""

    def tear_down(self) -> None:
        """Remove the stream."""


class _State(enum.Enum):
    INIT = "no session"
    READY = "ready"
    PLAYING = "playing"


@dataclass(frozen=True, kw_only=True)
class _Reply:
    headers: Mapping[str, str]
    body: bytes = b""


class Dialogue:
    """Session of one client, from its first request to the end of its connection.

    Args:
        actions: executes the requests.
        random: source of the unpredictable session name.
        timeout_s: session timeout that clients are informed of, s.
    """

    def __init__(self, actions: SessionActions, random: Random, *, timeout_s: float = 60.0) -> None:
        self._timeout_s = timeout_s
        self._actions = actions
        self._session = f"{random.getrandbits(64):016X}"
        self._state = _State.INIT
        self._handlers: Final[Mapping[str, Callable[[Request], _Reply]]] = {
            "OPTIONS": self._options,
            "DESCRIBE": self._describe,
            "SETUP": self._set_up,
            "PLAY": self._play,
            "PAUSE": self._pause,
            "GET_PARAMETER": self._get_parameter,
            "TEARDOWN": self._tear_down,
        }

    def reply(self, request: Request) -> bytes:
        """Execute a request and return its answer."""
        try:
            done = self._handle(request)
        except RtspError as error:
            return refusal(error, request.sequence)
        return answer(200, request.sequence, done.headers, done.body)

    def _handle(self, request: Request) -> _Reply:
        if not request.sequence:
            raise RtspError(400, "expected a number in the header CSeq")
        if "require" in request.headers:
            raise RtspError(
                551,
                "RTSP options are not supported",
                headers={"Unsupported": request.headers["require"]},
            )
        if request.method in _NOT_ALLOWED:
            raise RtspError(405, f"expected one of {_METHODS}", headers={"Allow": _METHODS})
        handler = self._handlers.get(request.method)
        if handler is None:
            raise RtspError(501, f"expected one of {_METHODS}", headers={"Public": _METHODS})
        return handler(request)

    def _options(self, request: Request) -> _Reply:
        if request.url != "*":
            _check_url(request)
        return _Reply(headers={"Public": _METHODS})

    def _describe(self, request: Request) -> _Reply:
        base = _check_url(request)
        accepted = request.headers.get("accept", "application/sdp").lower()
        if not any(kind in accepted for kind in ("application/sdp", "application/*", "*/*")):
            raise RtspError(406, "the stream is described by application/sdp only")
        headers = {"Content-Base": f"{base}/", "Content-Type": "application/sdp"}
        return _Reply(headers=headers, body=self._actions.description().encode())

    def _set_up(self, request: Request) -> _Reply:
        _check_url(request)
        if self._state is _State.PLAYING:
            raise RtspError(455, "the transport cannot be changed while playing; pause first")
        if self._state is not _State.INIT or "session" in request.headers:
            self._check_session(request)
        transport = self._actions.set_up(choose_transport(request.headers.get("transport", "")))
        self._state = _State.READY
        session = f"{self._session};timeout={self._timeout_s:.0f}"
        return _Reply(headers={"Transport": transport, "Session": session})

    def _play(self, request: Request) -> _Reply:
        base = _check_url(request)
        self._check_session(request)
        sequence, stamp = self._actions.play()
        self._state = _State.PLAYING
        info = f"url={base}/{_CONTROL};seq={sequence};rtptime={stamp}"
        return _Reply(headers={"Session": self._session, "RTP-Info": info})

    def _pause(self, request: Request) -> _Reply:
        _check_url(request)
        self._check_session(request)
        self._actions.pause()
        self._state = _State.READY
        return _Reply(headers={"Session": self._session})

    def _get_parameter(self, request: Request) -> _Reply:
        if request.url != "*":
            _check_url(request)
        if "session" in request.headers:
            self._check_session(request)
        if request.body.strip():
            raise RtspError(451, "no parameter is supported; an empty body keeps a session alive")
        return _Reply(headers={})

    def _tear_down(self, request: Request) -> _Reply:
        _check_url(request)
        self._check_session(request)
        self._actions.tear_down()
        self._state = _State.INIT
        return _Reply(headers={})

    def _check_session(self, request: Request) -> None:
        named = request.headers.get("session", "").partition(";")[0].strip()
        if self._state is _State.INIT or named != self._session:
            raise RtspError(454, "expected the session that SETUP returned on this connection")


def refusal(error: RtspError, sequence: str) -> bytes:
    """Return the answer to a refused request.

    Args:
        error: status and reason.
        sequence: number of the request; empty if unknown.
    """
    headers = {"Content-Type": "text/plain", **error.headers}
    return answer(error.status, sequence, headers, f"{error.why}\n".encode())


def describe(
    sets: ParameterSets, *, serial: str, host: str, session: int, media_name: str = DIRECT_MEDIUM
) -> str:
    """Return the SDP, which describes the stream to a client before the setup.

    Sources: RFC 8866 (SDP), RFC 6184 section 8.2 (H.264), Parrot's libsdp and
    libvideo-metadata. Olympe 8.5.0 finds the medium by its `i=` line. A session-wide
    `a=range:npt=now-` is an error for that parser, so it is omitted.

    Args:
        sets: the parameter sets of the H.264 stream.
        serial: serial number of the drone; Olympe shows it as metadata of the session.
        host: numeric address of the server.
        session: number of this session.
        media_name: name of the stream.
    """
    family = "IP6" if ":" in host else "IP4"
    sprop = ",".join(base64.b64encode(unit).decode() for unit in (sets.sps, sets.pps))
    parameters = (
        "packetization-mode=1",
        f"profile-level-id={sets.profile_level_id}",
        f"sprop-parameter-sets={sprop}",
    )
    lines = (
        "v=0",
        f"o=- {session} 1 IN {family} {host}",
        "s=ANAFI",
        "i=ANAFI",
        f"c=IN {family} {host}",
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
        f"a=control:{_CONTROL}",
        "a=X-com-parrot-default-media:1",
        "a=X-com-parrot-camera-type:front",
        "a=X-com-parrot-camera-spectrum:visible",
    )
    return "".join(f"{line}\r\n" for line in lines)


def _check_url(request: Request) -> str:
    """Return the URL of the stream without the part of the medium."""
    try:
        parts = urlsplit(request.url)
    except ValueError as error:
        raise RtspError(400, "expected a URL such as rtsp://127.0.0.1/live") from error
    path = parts.path.strip("/")
    if parts.scheme.lower() != "rtsp" or path not in {_PATH, f"{_PATH}/{_CONTROL}"}:
        raise RtspError(404, f"expected rtsp://ADDRESS/{_PATH}")
    return f"rtsp://{parts.netloc}/{_PATH}"
