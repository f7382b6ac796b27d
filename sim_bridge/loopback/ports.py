"""The ports of a loopback ANAFI, and what may be wrong with one."""

from __future__ import annotations

import errno
from dataclasses import dataclass

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
    if error.errno == errno.EADDRNOTAVAIL:
        return PortTakenError(f"this machine has no address {address}; use one of 127.0.0.x")
    return PortTakenError(f"{where} cannot be used: {error.strerror or error}")
