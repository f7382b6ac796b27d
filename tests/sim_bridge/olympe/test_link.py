"""Whether a drone is there."""

from __future__ import annotations

import socket
from dataclasses import replace

import pytest

from sim_bridge.olympe.link import probe
from tests.sim_bridge.olympe.fake_olympe import config
from uav_bt.errors import DroneError


def test_a_listening_port_is_a_drone() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        probe(replace(config(), address=f"127.0.0.1:{server.getsockname()[1]}"))


def test_a_closed_port_is_reported_with_a_hint() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(DroneError, match=r"cannot reach anafi at 127.*refused.*join its Wi-Fi"):
        probe(replace(config(), address=f"127.0.0.1:{port}"))
