"""Probe of an address for a drone."""

from __future__ import annotations

import socket
import threading
from dataclasses import replace

import pytest

from sim_bridge.olympe.probe import probe
from tests.sim_bridge.olympe.fake_olympe import config
from uav_bt.errors import DroneError


def test_a_listening_port_is_a_drone() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        probe(replace(config(), address=f"127.0.0.1:{server.getsockname()[1]}", probe_limit_s=0.1))


@pytest.mark.parametrize(
    ("announcement", "remote"),
    [
        (b'{"model.id": "0x0914"}\0', False),
        (b'{"model.id": "0x0918"}\0', True),
        (b"nonsense\0", False),
        (b"[]\0", False),
        (b"", False),
    ],
)
def test_a_remote_control_announces_itself(announcement: bytes, *, remote: bool) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def announce() -> None:
            connection, _ = server.accept()
            with connection:
                connection.sendall(announcement)

        announcing = threading.Thread(target=announce)
        announcing.start()
        found = probe(replace(config(), address=f"127.0.0.1:{server.getsockname()[1]}"))
        announcing.join()
    assert found is remote


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.3.4"])
def test_a_closed_port_of_this_machine_is_one_for_a_loopback_drone(host: str) -> None:
    with socket.create_server((host, 0)) as server:
        port = server.getsockname()[1]
    where = "" if host == "127.0.0.1" else f" --address {host}"
    advice = rf"cannot reach anafi at {host}.*refused.*`uav-bt serve-anafi{where}`"
    with pytest.raises(DroneError, match=advice):
        probe(replace(config(), address=f"{host}:{port}"))
