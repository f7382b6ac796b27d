"""Transports to a client: datagrams to its ports, or packets on the RTSP connection."""

from __future__ import annotations

import asyncio
import contextlib
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, Protocol

from sim_bridge.loopback.handshake import PortTakenError
from sim_bridge.loopback.video.rtsp_message import RtspError

# Limit of data in a client's buffer; above it, whole frames are dropped.
MAX_WAITING_BYTES: Final = 256 * 1024

_PAIR_TRIES: Final = 20  # tries to find an even port with a free neighbour
_MAX_PORT: Final = 65_535
_RANGE: Final = re.compile(r"(\d{1,5})(?:-(\d{1,5}))?")


class Sink(Protocol):
    """Destination of a client's packets."""

    @property
    def congested(self) -> bool:
        """Whether too much data is waiting to add more."""

    def send_data(self, packets: Iterable[bytes]) -> None:
        """Send RTP packets."""

    def send_control(self, packet: bytes) -> None:
        """Send an RTCP packet."""


@dataclass(frozen=True, kw_only=True)
class Transport:
    """Transport that a client requested in SETUP."""

    ports: tuple[int, int] | None = None  # RTP and RTCP ports; None if interleaved
    channels: tuple[int, int] | None = None  # RTP and RTCP channels; None for datagrams

    def header(self, server_ports: tuple[int, int], ssrc: int) -> str:
        """Return the `Transport` header of the answer.

        Args:
            server_ports: UDP ports of the server for RTP and RTCP.
            ssrc: identifier of the stream.
        """
        if self.channels is not None:
            channels = "-".join(map(str, self.channels))
            return f"RTP/AVP/TCP;unicast;interleaved={channels};ssrc={ssrc:08X}"
        ports = "-".join(map(str, self.ports or ()))
        server = "-".join(map(str, server_ports))
        return f"RTP/AVP;unicast;client_port={ports};server_port={server};ssrc={ssrc:08X}"


def choose_transport(header: str) -> Transport:
    """Return the first offered transport that is supported.

    Packets are sent to the client only: another destination in the header is ignored.

    Raises:
        RtspError: no offered transport is supported.
    """
    for offer in header.split(","):
        profile, *parameters = (part.strip() for part in offer.split(";"))
        named = dict(part.partition("=")[::2] for part in parameters)
        if "multicast" in named or named.get("mode", "play").strip('"').lower() != "play":
            continue
        if profile.upper() == "RTP/AVP/TCP":
            channels = _pair(named.get("interleaved", "0-1"), 255)
            if channels is not None:
                return Transport(channels=channels)
        elif profile.upper() in {"RTP/AVP", "RTP/AVP/UDP"}:
            ports = _pair(named.get("client_port", ""), _MAX_PORT)
            if ports is not None and ports[0] > 0:
                return Transport(ports=ports)
    raise RtspError(
        461,
        "expected 'RTP/AVP;unicast;client_port=A-B' or 'RTP/AVP/TCP;unicast;interleaved=A-B'",
    )


def _pair(text: str, largest: int) -> tuple[int, int] | None:
    found = _RANGE.fullmatch(text)
    if found is None:
        return None
    first = int(found[1])
    second = int(found[2]) if found[2] else first + 1
    return (first, second) if first != second and max(first, second) <= largest else None


class InterleavedSink:
    """Packets on the client's RTSP connection.

    Args:
        transport: the connection.
        channels: channels of RTP and RTCP.
    """

    def __init__(self, transport: asyncio.Transport, channels: tuple[int, int]) -> None:
        self._transport = transport
        self._data, self._control = channels

    @property
    def congested(self) -> bool:
        """Whether the client reads too slowly."""
        return self._transport.get_write_buffer_size() > MAX_WAITING_BYTES

    def send_data(self, packets: Iterable[bytes]) -> None:
        """Send RTP packets."""
        self._transport.write(b"".join(self._framed(self._data, one) for one in packets))

    def send_control(self, packet: bytes) -> None:
        """Send an RTCP packet."""
        self._transport.write(self._framed(self._control, packet))

    @staticmethod
    def _framed(channel: int, packet: bytes) -> bytes:
        return bytes([0x24, channel]) + len(packet).to_bytes(2, "big") + packet


class _Flow(asyncio.DatagramProtocol):
    """Tracks whether the system accepts more datagrams."""

    def __init__(self) -> None:
        self.paused = False

    def pause_writing(self) -> None:
        """Mark the socket as congested."""
        self.paused = True

    def resume_writing(self) -> None:
        """Mark the socket as free."""
        self.paused = False


class _Reports(asyncio.DatagramProtocol):
    """Receives RTCP reports; only their sender is used."""

    def __init__(self, received: Callable[[tuple[str, int]], None]) -> None:
        self._received = received

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:  # noqa: ARG002  (asyncio's)
        """Forward the address of the sender."""
        self._received((addr[0], addr[1]))


@dataclass(frozen=True, kw_only=True)
class DatagramPair:
    """The two sockets of the server, shared by all clients."""

    data: asyncio.DatagramTransport
    control: asyncio.DatagramTransport
    flow: _Flow  # congestion of the data socket
    ports: tuple[int, int]

    def close(self) -> None:
        """Free the ports."""
        self.data.close()
        self.control.close()


class DatagramSink:
    """Datagrams to a client's two ports.

    Args:
        pair: sockets of the server.
        host: numeric address of the client.
        ports: ports of the client for RTP and RTCP.
    """

    def __init__(self, pair: DatagramPair, host: str, ports: tuple[int, int]) -> None:
        self._pair = pair
        self._data = (host, ports[0])
        self._control = (host, ports[1])

    @property
    def congested(self) -> bool:
        """Whether the system accepts no more datagrams now."""
        return self._pair.flow.paused

    def send_data(self, packets: Iterable[bytes]) -> None:
        """Send RTP packets."""
        for packet in packets:
            self._pair.data.sendto(packet, self._data)

    def send_control(self, packet: bytes) -> None:
        """Send an RTCP packet."""
        self._pair.control.sendto(packet, self._control)


async def open_datagram_pair(
    host: str, received: Callable[[tuple[str, int]], None]
) -> DatagramPair:
    """Open an even port and the next port, as RTP requires.

    Args:
        host: numeric address to send from.
        received: called with the address of each sender to the control port.

    Raises:
        PortTakenError: no pair was free.
    """
    loop = asyncio.get_running_loop()
    for _ in range(_PAIR_TRIES):
        data, flow = await loop.create_datagram_endpoint(_Flow, local_addr=(host, 0))
        port = data.get_extra_info("sockname")[1]
        if port % 2 == 0:
            with contextlib.suppress(OSError):  # the neighbour is taken: try the next pair
                control, _reports = await loop.create_datagram_endpoint(
                    lambda: _Reports(received), local_addr=(host, port + 1)
                )
                return DatagramPair(data=data, control=control, flow=flow, ports=(port, port + 1))
        data.close()
    raise PortTakenError(
        f"found no two neighbouring free UDP ports on {host} in {_PAIR_TRIES} tries; end some "
        "programs that listen there"
    )
