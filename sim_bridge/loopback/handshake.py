"""How a client finds the drone and gets a command link: its ports, and two JSON exchanges over TCP.

Port 44445: the drone sends its identity as soon as a client connects, and keeps the connection;
losing it is how a client notices that the drone is gone. Port 44444: the client sends the port for
events, the drone answers with the port for commands.
"""

from __future__ import annotations

import asyncio
import errno
import json
from dataclasses import dataclass
from typing import Any, Final

from sim_bridge.loopback.codec import WireError
from uav_bt.errors import InputError


class PortTakenError(InputError):
    """A port of the drone is taken, or may not be used."""


@dataclass(frozen=True, kw_only=True)
class Ports:
    """Where the drone listens; 0 is any free port."""

    discovery: int = 44445  # TCP
    control: int = 44444  # TCP: requests for a link
    commands: int = 2233  # UDP
    http: int = 80  # TCP
    rtsp: int = 554  # TCP: the video


def port_error(error: OSError, address: str, port: int, service: str) -> PortTakenError:
    """Return what to report when a port could not be bound.

    Args:
        error: what the system raised.
        address: the numeric address.
        port: the port; 0 for any free one.
        service: what the port is for, for people.
    """
    where = f"the {service} port {port} of {address}"
    if error.errno == errno.EADDRINUSE:
        return PortTakenError(
            f"{where} is taken; stop what uses it, choose another port, or another address such "
            "as 127.0.0.2"
        )
    if error.errno in (errno.EACCES, errno.EPERM):
        return PortTakenError(f"{where} needs root; choose one above 1023, such as 8554")
    # From Python 3.13 on asyncio leaves out the number where no address could be bound.
    if error.errno in (errno.EADDRNOTAVAIL, None):
        return PortTakenError(f"this machine has no address {address}; use one of 127.0.0.x")
    return PortTakenError(f"{where} cannot be used: {error.strerror or error}")


MAX_REQUEST_BYTES: Final = 8192  # a client's request has some 200
_BUSY: Final = -1
_FRAMES_VERSION: Final = 2
_REQUEST_TIMEOUT_S: Final = 5.0  # s for a client's request for a link to arrive


@dataclass(frozen=True, kw_only=True)
class Identity:
    """Name, serial number and model of the drone, or of its remote control."""

    name: str = "ANAFI-loopback"
    serial: str = "PI040384AH8L000000"  # of the form that the ANAFI's has; no real one
    model: int = 0x0914  # the ANAFI 4K


SKYCONTROLLER: Final = Identity(
    name="SkyController3-loopback", serial="PI040401AA0A000000", model=0x0918
)


@dataclass(frozen=True, kw_only=True)
class ConnectionRequest:
    """A client's request for a link."""

    events_port: int  # UDP, on the client's side
    controller: str = ""


def announcement(identity: Identity, control_port: int) -> bytes:
    """Return what the drone sends on its discovery port.

    Args:
        identity: name and serial number.
        control_port: where a client asks for a link (TCP).
    """
    return _line(
        {
            "model.id": f"0x{identity.model:04x}",
            "serial": identity.serial,
            "port": control_port,
            "name": identity.name,
        }
    )


def parse_request(data: bytes) -> ConnectionRequest:
    """Read a client's request for a link.

    Raises:
        WireError: it is none.
    """
    try:
        request = json.loads(data.rstrip(b"\0").decode())
    except (UnicodeDecodeError, ValueError, RecursionError) as error:
        raise WireError(f"a request for a link is a JSON object, got {data[:80]!r}") from error
    port = request.get("d2c_port") if isinstance(request, dict) else None
    if not isinstance(port, int) or isinstance(port, bool) or not 0 < port < 65536:
        raise WireError(f"a request for a link names d2c_port, a UDP port, got {data[:80]!r}")
    newest = request.get("proto_v_max", 1)
    if not isinstance(newest, int) or newest < _FRAMES_VERSION:
        raise WireError(
            f"a client speaks version {_FRAMES_VERSION} of the frames, got {data[:80]!r}"
        )
    return ConnectionRequest(
        events_port=port,
        controller=str(request.get("controller_name", "")),
    )


async def read_request(reader: asyncio.StreamReader) -> ConnectionRequest:
    """Read a request for a link, with or without the NUL at its end.

    Raises:
        WireError: it is none, too long or too slow.
    """
    data = b""
    try:
        async with asyncio.timeout(_REQUEST_TIMEOUT_S):
            while len(data) <= MAX_REQUEST_BYTES:
                more = await reader.read(MAX_REQUEST_BYTES)
                data += more
                if not more or data.endswith((b"\0", b"}", b"}\n")):
                    return parse_request(data)
    except TimeoutError as error:
        raise WireError(f"no request for a link within {_REQUEST_TIMEOUT_S} s") from error
    raise WireError(f"a request for a link has at most {MAX_REQUEST_BYTES} bytes")


def accepted(commands_port: int) -> bytes:
    """Return the answer that opens a link; commands go to a UDP port."""
    return _line(
        {
            "status": 0,
            "c2d_port": commands_port,
            "c2d_update_port": 51,
            "c2d_user_port": 21,
            "qos_mode": 0,
            "proto_v": _FRAMES_VERSION,
        }
    )


def refused() -> bytes:
    """Return the answer to a client that comes while another one flies."""
    return _line({"status": _BUSY})


def _line(message: dict[str, Any]) -> bytes:
    return json.dumps(message).encode() + b"\0"
