"""Discovery and connection of a client: the ports, and two JSON exchanges over TCP.

Port 44445: the drone sends its identity when a client connects, and keeps the connection open. A
client that loses this connection concludes that the drone is gone. Port 44444: the client sends its
port for events, and the drone answers with its port for commands.
"""

from __future__ import annotations

import asyncio
import errno
import json
from dataclasses import dataclass
from typing import Annotated, Any, Final

from annotated_types import Ge, Le

from sim_bridge.loopback.codec import WireError
from uav_bt.errors import InputError
from uav_bt.option import Option


class PortTakenError(InputError):
    """A port of the drone is taken, or may not be used."""


_Port = Annotated[int, Ge(0), Le(65_535)]


@dataclass(frozen=True, kw_only=True)
class Ports:
    """Ports on which the drone listens.

    Options:
        discovery: TCP, where clients find it; 0 takes a free one.
        control: TCP, where clients ask for a link; 0 takes a free one.
        commands: UDP, where commands go; 0 takes a free one.
        http: TCP, its web server; 0 takes a free one.
        rtsp: TCP, its video; 0 takes a free one.
    """

    discovery: Annotated[_Port, Option(form="--discovery-port")] = 44445
    control: Annotated[_Port, Option(form="--control-port")] = 44444
    commands: Annotated[_Port, Option(form="--commands-port")] = 2233
    http: Annotated[_Port, Option(form="--http-port")] = 80
    rtsp: Annotated[_Port, Option(form="--rtsp-port")] = 554


def port_error(error: OSError, address: str, port: int, service: str) -> PortTakenError:
    """Return the error for a port that could not be bound.

    Args:
        error: the error of the system.
        address: the numeric address.
        port: the port; 0 selects a free one.
        service: purpose of the port, for the message.
    """
    where = f"the {service} port {port} of {address}"
    if error.errno == errno.EADDRINUSE:
        return PortTakenError(
            f"{where} is taken; stop the other program, choose another port, or another "
            "address such as 127.0.0.2"
        )
    if error.errno in (errno.EACCES, errno.EPERM):
        return PortTakenError(f"{where} needs root; choose one above 1023, such as 8554")
    # Since Python 3.13 asyncio omits the number if no address could be bound.
    if error.errno in (errno.EADDRNOTAVAIL, None):
        return PortTakenError(f"this machine has no address {address}; use one of 127.0.0.x")
    return PortTakenError(f"{where} cannot be used: {error.strerror or error}")


MAX_REQUEST_BYTES: Final = 8192  # a request has about 200
_BUSY: Final = -1
_FRAMES_VERSION: Final = 2
_REQUEST_TIMEOUT_S: Final = 5.0  # timeout of a client's request for a link, s


@dataclass(frozen=True, kw_only=True)
class Identity:
    """Name, serial number and model of the drone, or of its remote control."""

    name: str = "ANAFI-loopback"
    serial: str = "PI040384AH8L000000"  # not a real one, but in the format of the ANAFI
    model: int = 0x0914  # the ANAFI 4K


SKYCONTROLLER: Final = Identity(
    name="SkyController3-loopback", serial="PI040401AA0A000000", model=0x0918
)


@dataclass(frozen=True, kw_only=True)
class ConnectionRequest:
    """A client's request for a link."""

    events_port: int  # UDP port of the client
    controller: str = ""


def announcement(identity: Identity, control_port: int) -> bytes:
    """Return the message that the drone sends on its discovery port.

    Args:
        identity: name and serial number.
        control_port: TCP port for requests for a link.
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
    """Parse a client's request for a link.

    Raises:
        WireError: the data is not a request for a link.
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
    """Read a request for a link, with or without a NUL at its end.

    Raises:
        WireError: the data is not a request for a link, is too long, or arrives too slowly.
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
    """Return the answer that opens a link and names the UDP port for commands."""
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
    """Return the answer to a client that connects while another one flies."""
    return _line({"status": _BUSY})


def _line(message: dict[str, Any]) -> bytes:
    return json.dumps(message).encode() + b"\0"
