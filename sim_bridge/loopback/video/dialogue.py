"""One client's RTSP session: requests to answers, without sockets.

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
DIRECT_MEDIUM: Final = "Front camera"  # what a drone calls its video to a client on its own Wi-Fi
REMOTE_MEDIUM: Final = "DefaultVideo"  # and what is reported of one behind a remote control
_CONTROL: Final = "stream=0"

_METHODS: Final = "OPTIONS, DESCRIBE, SETUP, PLAY, PAUSE, GET_PARAMETER, TEARDOWN"
# Methods of the RFC that a server of live video does not have.
_NOT_ALLOWED: Final = frozenset({"ANNOUNCE", "RECORD", "REDIRECT", "SET_PARAMETER"})


class SessionActions(Protocol):
    """The effects of a client's requests."""

    def description(self) -> str:
        """Return the SDP."""

    def set_up(self, transport: Transport) -> str:
        """Prepare a stream, in place of an earlier one, and return the answer's `Transport`.

        Raises:
            RtspError: there are too many already.
        """

    def play(self) -> tuple[int, int]:
        """Begin to send; return the next packet's sequence number and the present time stamp.

        Raises:
            RtspError: there is no video any more.
        """

    def pause(self) -> None:
        """Stop sending."""

    def tear_down(self) -> None:
        """Forget the stream."""


class _State(enum.Enum):
    INIT = "no session"
    READY = "ready"
    PLAYING = "playing"


@dataclass(frozen=True, kw_only=True)
class _Reply:
    headers: Mapping[str, str]
    body: bytes = b""


class Dialogue:
    """One client's session, from its first request to the end of its connection.

    Args:
        actions: carries the requests out.
        random: gives the session its unpredictable name.
        timeout_s: without anything from the client, s; as clients are informed.
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
        """Carry a request out and return its answer."""
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
                "no options of RTSP are supported",
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
            raise RtspError(451, "there are no parameters; without a body it keeps a session alive")
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
            raise RtspError(454, "expected the session that SETUP has given on this connection")


def refusal(error: RtspError, sequence: str) -> bytes:
    """Return the answer to a request that is refused.

    Args:
        error: status and reason.
        sequence: the request's number; empty where it is not known.
    """
    headers = {"Content-Type": "text/plain", **error.headers}
    return answer(error.status, sequence, headers, f"{error.why}\n".encode())


def describe(
    sets: ParameterSets, *, serial: str, host: str, session: int, media_name: str = DIRECT_MEDIUM
) -> str:
    """Return the SDP, by which a client knows the stream before it is set up.

    Source: RFC 8866 (SDP), RFC 6184 section 8.2 (H.264), and what Parrot's libsdp and
    libvideo-metadata read: `i=` of the medium is the name by which Olympe 8.5.0 finds it, and a
    session-wide `a=range:npt=now-` is an error to that parser, so that there is none.

    Args:
        sets: the parameter sets of the H.264 stream.
        serial: the drone's serial number, which Olympe shows as the session's metadata.
        host: the server's numeric address.
        session: a number for this session.
        media_name: what the stream is called.
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
    """Return the stream's URL without the part that names the medium."""
    try:
        parts = urlsplit(request.url)
    except ValueError as error:
        raise RtspError(400, "expected a URL such as rtsp://127.0.0.1/live") from error
    path = parts.path.strip("/")
    if parts.scheme.lower() != "rtsp" or path not in {_PATH, f"{_PATH}/{_CONTROL}"}:
        raise RtspError(404, f"expected rtsp://ADDRESS/{_PATH}")
    return f"rtsp://{parts.netloc}/{_PATH}"
