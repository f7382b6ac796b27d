"""Transports to a client."""

from __future__ import annotations

import asyncio

import pytest

from sim_bridge.loopback.video.rtsp_message import RtspError
from sim_bridge.loopback.video.transport import (
    DatagramSink,
    Transport,
    choose_transport,
    open_datagram_pair,
)
from tests.sim_bridge.loopback.video.video_client import open_inbox, run


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        ("RTP/AVP;unicast;client_port=5000-5001", Transport(ports=(5000, 5001))),
        ("RTP/AVP/UDP;unicast;client_port=5000-5001", Transport(ports=(5000, 5001))),
        ("rtp/avp; unicast; client_port=5000", Transport(ports=(5000, 5001))),
        ("RTP/AVP/TCP;unicast;interleaved=2-3", Transport(channels=(2, 3))),
        ("RTP/AVP/TCP;unicast", Transport(channels=(0, 1))),
        ('RTP/AVP;unicast;client_port=1-2;mode="PLAY"', Transport(ports=(1, 2))),
        # The first supported one of several.
        ("RTP/AVP;multicast,RTP/AVP/TCP;interleaved=0-1", Transport(channels=(0, 1))),
    ],
)
def test_offers_are_understood(header: str, expected: Transport) -> None:
    assert choose_transport(header) == expected


@pytest.mark.parametrize(
    "header",
    [
        "",
        "RTP/AVP;unicast",
        "RTP/AVP;multicast;port=5000-5001",
        "RTP/AVP;unicast;client_port=0-1",
        "RTP/AVP;unicast;client_port=65535",
        "RTP/AVP;unicast;client_port=5000-5000",
        "RTP/AVP;unicast;client_port=99999-100000",
        "RTP/AVP;unicast;client_port=\u0665-\u0666x",
        "RTP/AVP/TCP;interleaved=255",
        "RTP/AVP/TCP;interleaved=a-b",
        "RTP/AVP;unicast;client_port=1-2;mode=record",
    ],
)
def test_offers_that_cannot_be_had_are_refused(header: str) -> None:
    with pytest.raises(RtspError, match="expected 'RTP/AVP") as caught:
        choose_transport(header)
    assert caught.value.status == 461


def test_a_clients_wish_for_another_destination_is_not_granted() -> None:
    """A client must not be able to direct the stream to another host."""
    header = "RTP/AVP;unicast;client_port=5000-5001;destination=192.0.2.1"
    assert choose_transport(header) == Transport(ports=(5000, 5001))


def test_the_answer_repeats_what_was_chosen() -> None:
    by_udp = Transport(ports=(5000, 5001)).header((6000, 6001), 0xAB)
    assert by_udp == "RTP/AVP;unicast;client_port=5000-5001;server_port=6000-6001;ssrc=000000AB"
    by_tcp = Transport(channels=(2, 3)).header((6000, 6001), 0xAB)
    assert by_tcp == "RTP/AVP/TCP;unicast;interleaved=2-3;ssrc=000000AB"


def test_datagrams_reach_their_ports_and_reports_are_heard() -> None:
    async def work() -> None:
        heard: asyncio.Queue[tuple[str, int]] = asyncio.Queue()
        pair = await open_datagram_pair("127.0.0.1", heard.put_nowait)
        assert pair.ports[0] % 2 == 0
        assert pair.ports[1] == pair.ports[0] + 1
        data, data_box, data_port = await open_inbox()
        control, control_box, control_port = await open_inbox()
        sink = DatagramSink(pair, "127.0.0.1", (data_port, control_port))
        assert not sink.congested
        sink.send_data([b"one", b"two"])
        sink.send_control(b"report")
        assert [await data_box.queue.get() for _ in range(2)] == [b"one", b"two"]
        assert await control_box.queue.get() == b"report"
        control.sendto(b"answer", ("127.0.0.1", pair.ports[1]))
        assert await heard.get() == ("127.0.0.1", control_port)
        for transport in (data, control):
            transport.close()
        pair.close()

    run(work())
