"""Addresses and limits, the probe of an address, and the import of the SDK."""

from __future__ import annotations

import logging
import socket
import sys
import threading
from types import SimpleNamespace

import pytest

from sim_bridge.olympe import AnafiConfig, SphinxConfig
from sim_bridge.olympe.drone import OlympeDrone
from sim_bridge.olympe.probe import probe
from tests.sim_bridge.olympe.fake_olympe import FakeWorld, config
from uav_bt.errors import DroneError, InputError, MissingDependencyError, ValueRangeError
from uav_bt.protocols import Drone


@pytest.mark.parametrize(
    ("made", "where"),
    [
        (AnafiConfig(), "anafi at 192.168.42.1:44445"),
        (AnafiConfig(address="127.0.0.2"), "anafi at 127.0.0.2:44445"),
        (SphinxConfig(address="drone.lab:45000"), "sphinx at drone.lab:45000"),
    ],
)
def test_a_port_is_optional(made: AnafiConfig | SphinxConfig, where: str) -> None:
    assert made.where == where
    assert isinstance(made.create(), Drone)


@pytest.mark.parametrize("address", ["", ":1", "a:b", "::1", "a b", "127.0.0.1:", "x:70000", "x:0"])
def test_a_malformed_address_is_refused_with_an_example(address: str) -> None:
    with pytest.raises(InputError, match="expected HOST or HOST:DISCOVERY_PORT, for instance"):
        AnafiConfig(address=address)


def test_limits_are_positive() -> None:
    with pytest.raises(ValueRangeError, match="speed_limit_mps must be a positive number"):
        config(speed_limit_mps=0.0)


@pytest.mark.parametrize(
    ("announcement", "remote"),
    [
        (b'{"model.id": "0x0914"}\0', False),
        (b'{"model.id": "0x0918"}\0', True),
        (b"nonsense\0", False),
    ],
)
def test_a_remote_control_announces_itself(announcement: bytes, *, remote: bool) -> None:
    def announce() -> None:
        with server.accept()[0] as connection:
            connection.sendall(announcement)

    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=announce).start()
        assert probe(config(address=f"127.0.0.1:{server.getsockname()[1]}")) is remote


@pytest.mark.parametrize(
    ("address", "error", "message"),
    [
        ("127.0.3.4", OSError(111, "no"), r"reach .*\(no\): .*`uav-bt serve-anafi --address 127"),
        (None, TimeoutError(), "no answer from anafi at .* within 2 s: switch the drone on"),
        ("nobody", socket.gaierror(), "the host 'nobody' is unknown: check its spelling"),
    ],
)
def test_nobody_at_the_address_is_an_error_with_advice(
    monkeypatch: pytest.MonkeyPatch, address: str | None, error: OSError, message: str
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(socket, "create_connection", refuse)
    with pytest.raises(DroneError, match=message):
        probe(AnafiConfig(address=address))


def test_a_missing_sdk_is_reported_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "olympe", None)
    drone = OlympeDrone(config(), probe_first=lambda _: pytest.fail("looked for the drone"))
    with pytest.raises(MissingDependencyError, match=r"Parrot's SDK .*docs/real-drone\.md"):
        drone.connect()
    assert logging.root.manager.disable == logging.NOTSET


def test_behind_a_remote_control_the_web_server_is_at_the_proxy() -> None:
    proxy = SimpleNamespace(address="127.0.0.9", port=1234)
    for drone, address in (
        (SimpleNamespace(http_proxy=proxy), ("127.0.0.9", 1234)),
        (SimpleNamespace(), ("127.0.0.1", 180)),  # the older SDK shows no proxy
    ):
        assert FakeWorld().sdk().web_address(drone, config(), remote=True) == address
