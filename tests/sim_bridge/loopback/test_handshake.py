"""The two JSON exchanges that open a link."""

from __future__ import annotations

import json
from typing import Any

import pytest

from sim_bridge.loopback.codec import WireError
from sim_bridge.loopback.handshake import Identity, accepted, announcement, parse_request, refused

REQUEST = {"controller_name": "olympe", "d2c_port": 9988, "proto_v_min": 1, "proto_v_max": 3}


def request(**changes: Any) -> bytes:
    return json.dumps(REQUEST | changes).encode()


def test_the_drone_announces_an_anafi_and_its_control_port() -> None:
    data = announcement(Identity(name="lab", serial="PI04"), 44444)
    assert data.endswith(b"\0")
    card = {"model.id": "0x0914", "serial": "PI04", "port": 44444, "name": "lab"}
    assert json.loads(data[:-1]) == card


@pytest.mark.parametrize("end", [b"", b"\0"])
def test_a_request_names_the_clients_port(end: bytes) -> None:
    found = parse_request(request() + end)
    assert (found.events_port, found.controller) == (9988, "olympe")


def test_the_answer_is_a_port_for_commands_or_a_refusal() -> None:
    answer = json.loads(accepted(2233)[:-1])
    assert (answer["status"], answer["c2d_port"], answer["proto_v"]) == (0, 2233, 2)
    assert json.loads(refused()[:-1]) == {"status": -1}


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xff",
        b"[]",
        b"[" * 5000,
        request(d2c_port=0),
        request(d2c_port=True),
        request(d2c_port="9988"),
        request(proto_v_max=1),
        request(proto_v_max="2"),
    ],
)
def test_what_is_no_request_is_refused(data: bytes) -> None:
    with pytest.raises(WireError, match=r"a request for a link|a client speaks"):
        parse_request(data)
