"""Discovery and connection of a client: the ports, and two JSON exchanges over TCP.

Port 44445: the drone sends its identity when a client connects, and keeps the connection open. A
client that loses this connection concludes that the drone is gone. Port 44444: the client sends its
port for events, and the drone answers with its port for commands.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import json
from dataclasses import dataclass
from typing import Annotated, Final

from annotated_types import Ge, Le
from pydantic import BaseModel, ConfigDict, Field, ValidationError

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
    """Return the error for a port that could not be bound; `service` is its purpose."""
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


@dataclass(frozen=True, kw_only=True)
class Identity:
    """Name, serial number and model of a device; the numbers are not real, but in the format."""

    name: str
    serial: str
    model: int


ANAFI: Final = Identity(name="ANAFI-loopback", serial="PI040384AH8L000000", model=0x0914)  # the 4K
SKYCONTROLLER: Final = Identity(
    name="SkyController3-loopback", serial="PI040401AA0A000000", model=0x0918
)

_MAX_REQUEST_BYTES: Final = 8192  # a request has about 200
_REQUEST_S: Final = 5.0  # timeout of a client's request for a link, s
_BUSY: Final = -1
_FRAMES_VERSION: Final = 2


class Request(BaseModel):
    """A client's request for a link."""

    model_config = ConfigDict(strict=True)

    d2c_port: int = Field(gt=0, lt=65_536)  # UDP port of the client, for events
    proto_v_max: int = Field(ge=_FRAMES_VERSION)  # newest version of the frames
    controller_name: str = "a client"


def announcement(identity: Identity, control_port: int) -> bytes:
    """Return the message that the drone sends on its discovery port."""
    model, serial, name = f"0x{identity.model:04x}", identity.serial, identity.name
    return _line({"model.id": model, "serial": serial, "port": control_port, "name": name})


async def read_request(reader: asyncio.StreamReader) -> Request:
    """Read a request for a link, with or without a NUL at its end; WireError for other bytes."""
    data = b""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(_REQUEST_S):
            while not data.endswith((b"\0", b"}", b"}\n")) and len(data) < _MAX_REQUEST_BYTES:
                more = await reader.read(_MAX_REQUEST_BYTES)
                if not more:
                    break
                data += more
    try:
        return Request.model_validate_json(data.rstrip(b"\0"))
    except ValidationError as error:
        raise WireError(f"no request for a link: {data[:80]!r}: {error}") from error


def answer(commands_port: int | None) -> bytes:
    """Return the answer that opens a link and names the UDP port for commands; None refuses it."""
    if commands_port is None:
        return _line({"status": _BUSY})
    ports = {"c2d_port": commands_port, "c2d_update_port": 51, "c2d_user_port": 21}
    return _line({"status": 0, **ports, "qos_mode": 0, "proto_v": _FRAMES_VERSION})


def _line(message: dict[str, object]) -> bytes:
    return json.dumps(message).encode() + b"\0"
