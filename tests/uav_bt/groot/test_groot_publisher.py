"""The Groot2 publisher, tested by a client over a real loopback connection."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from typing import Any

import pytest
import zmq

from tests.uav_bt.groot.groot_world import (
    HEIGHT,
    GrootClient,
    free_ports,
    leaf,
    make_context,
    make_tree,
)
from uav_bt.board.context import MissionContext
from uav_bt.clock import ManualClock
from uav_bt.errors import InputError
from uav_bt.groot import GrootPublisher, TreeWatch
from uav_bt.groot.groot_view import MAX_RECORDED
from uav_bt.tree import MissionTree

INNER = f'<BehaviorTree ID="Inner">{leaf("in", "RS")}</BehaviorTree>'
BODY = f"""
<Sequence name="all">
  {leaf("first", "S")}
  <SubTree ID="Inner" name="inside" amount="3"/>
  {leaf("last", "FR")}
</Sequence>"""


class Mission:
    """A running tree with a publisher."""

    def __init__(self, publisher: GrootPublisher, body: str = BODY, *more: str) -> None:
        self.clock = ManualClock()
        self.context: MissionContext = make_context(self.clock)
        self.tree: MissionTree = make_tree(body, *(more or (INNER,)))
        self.tree.setup(self.context)
        self.watch = TreeWatch(self.tree, self.context, publisher=publisher)

    def tick(self, times: int = 1) -> None:
        for _ in range(times):
            self.tree.tick()
            self.watch.on_tick()
            self.clock.advance(0.1)


@pytest.fixture
def port() -> int:
    return free_ports()


@pytest.fixture
def publisher(port: int) -> Iterator[GrootPublisher]:
    with GrootPublisher(port) as publisher:
        yield publisher


@pytest.fixture
def mission(publisher: GrootPublisher) -> Mission:
    return Mission(publisher)


@pytest.fixture
def client(publisher: GrootPublisher, port: int) -> Iterator[GrootClient]:
    with GrootClient(port) as client:
        yield client


def header(type_: bytes, protocol: int = 2) -> bytes:
    return bytes([protocol]) + type_ + b"\x01\0\0\0"


# --- supported requests ---------------------------------------------------------------------------


def test_the_tree_is_sent_with_numbers_and_paths(mission: Mission, client: GrootClient) -> None:
    root = client.tree()
    assert root.get("BTCPP_format") == "4"
    trees = {tree.get("ID"): tree for tree in root.iter("BehaviorTree")}
    assert {name: tree.get("_fullpath") for name, tree in trees.items()} == {
        "Main": "",
        "Inner": "inside",
    }
    uids = {
        element.get("name"): int(element.get("_uid", "0"))
        for element in root.iter()
        if element.get("_uid")
    }
    assert uids == {"all": 1, "first": 2, "inside": 3, "in": 4, "last": 5}
    assert root.find("TreeNodesModel/Action[@ID='Scripted']/input_port[@name='script']") is not None


def test_the_tree_keeps_its_id_and_another_tree_has_another(
    publisher: GrootPublisher, mission: Mission, client: GrootClient
) -> None:
    ids = {client.ask(type_)[0] for type_ in "TSt"}
    assert len(ids) == 1
    Mission(publisher)
    assert client.ask("S")[0] not in ids


def test_statuses_tell_what_an_idle_node_was(mission: Mission, client: GrootClient) -> None:
    """Running is 1, success 2, failure 3; newly idle is 10 more than the former status."""
    assert client.statuses() == dict.fromkeys(range(1, 6), 0)
    mission.tick()
    assert client.statuses() == {1: 1, 2: 2, 3: 1, 4: 1, 5: 0}
    mission.tick()
    assert client.statuses() == {1: 13, 2: 12, 3: 12, 4: 12, 5: 13}
    mission.tick()
    assert client.statuses() == {1: 1, 2: 2, 3: 2, 4: 12, 5: 1}
    mission.tree.halt()
    mission.watch.finish()
    assert client.statuses() == {1: 11, 2: 12, 3: 12, 4: 12, 5: 11}


def test_blackboards_come_by_the_names_of_the_trees(mission: Mission, client: GrootClient) -> None:
    """That of the main tree includes the mission's board; unknown names are omitted."""
    mission.tree.variables["count"] = 7
    mission.context.board.write(HEIGHT, 1.5)
    mission.tick()
    assert client.boards("Main", "inside", "nowhere") == {
        "Main": {"count": 7, "@height_m": 1.5},
        "inside": {"amount": 3},
    }
    assert client.boards("") == {}
    mission.tree.variables["late"] = 1  # in the next tick
    assert "late" not in client.boards("Main")["Main"]


def test_transitions_are_recorded_between_start_and_stop(
    mission: Mission, client: GrootClient
) -> None:
    mission.tick()  # before the first request
    assert client.ask("r", b"start")[1] == [b"0"]  # the time of the last tick, microseconds
    assert client.transitions() == []
    mission.tick()
    ended = [(100_000, *item) for item in ((4, 2), (3, 2), (4, 0), (5, 3), (2, 0), (3, 0), (5, 0))]
    assert client.transitions() == [*ended, (100_000, 1, 3), (100_000, 1, 0)]
    assert client.transitions() == []
    mission.tick()
    assert client.ask("r", b"stop")[1] == []
    mission.tick()
    assert {time for time, _, _ in client.transitions()} == {200_000}


def test_a_recording_that_nobody_fetches_stays_bounded(
    mission: Mission, client: GrootClient
) -> None:
    client.ask("r", b"start")
    for _ in range(MAX_RECORDED // 3):  # each leaves at least three transitions
        mission.tree.tick()
        mission.tree.halt()
    mission.watch.on_tick()
    assert len(client.transitions()) == MAX_RECORDED


# --- refused requests -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("frames", "words"),
    [
        ([b""], "expected 6 bytes, got 0"),
        ([b"\x02T"], "expected 6 bytes, got 2"),
        ([header(b"T") + b"!"], "expected 6 bytes, got 7"),
        ([header(b"T", protocol=1)], "expected protocol 2, got 1"),
        ([header(b"Z")], "request not recognized: type 90"),
        ([header(b"\xff")], "request not recognized: type 255"),
        ([header(b"T"), b"", b""], "1 or 2 parts, got 3"),
        ([header(b"B")], "must be 2 parts message"),
        ([header(b"B"), b"\xff\xfe"], "must be UTF-8 text"),
        ([header(b"r")], "must be 2 parts message"),
        ([header(b"r"), b"faster"], "'start' or 'stop', got 'faster'"),
        *(([header(bytes([one])), b"{}"], f"changed (request '{one:c}')") for one in b"IRDAXUN"),
    ],
)
def test_a_bad_request_is_answered_with_the_reason(
    mission: Mission, client: GrootClient, frames: list[bytes], words: str
) -> None:
    assert words in client.refusal(*frames)
    assert len(client.statuses()) == 5


def test_a_request_too_large_ends_the_connection_not_the_server(
    port: int, mission: Mission, client: GrootClient
) -> None:
    with zmq.Context() as context, context.socket(zmq.REQ) as rude:
        rude.setsockopt(zmq.LINGER, 0)
        rude.connect(f"tcp://127.0.0.1:{port}")
        rude.send(b"x" * 1_000_000)
    assert len(client.statuses()) == 5


@pytest.mark.parametrize(
    "noise",
    [
        b"GET / HTTP/1.1\r\n\r\n" + bytes(range(256)) * 10,
        b"\xff\0\0\0\0\0\0\0\x01\x7f",  # start of a ZeroMQ greeting
        b"\x01\0\x02\0x" * 50,  # frames of the oldest ZeroMQ
    ],
)
def test_noise_on_the_port_is_survived(
    port: int, mission: Mission, client: GrootClient, noise: bytes
) -> None:
    for _ in range(5):
        with socket.create_connection(("127.0.0.1", port)) as raw:
            raw.sendall(noise)
        assert len(client.statuses()) == 5


def test_a_client_of_another_kind_gets_no_answer_and_does_no_harm(
    port: int, mission: Mission, client: GrootClient
) -> None:
    """Requests come from REQ sockets, which send an empty frame first."""
    with zmq.Context() as context, context.socket(zmq.DEALER) as dealer:
        dealer.setsockopt(zmq.LINGER, 0)
        dealer.setsockopt(zmq.RCVTIMEO, 5000)
        dealer.connect(f"tcp://127.0.0.1:{port}")
        dealer.send_multipart([header(b"S")])
        dealer.send_multipart([header(b"S"), b""])
        dealer.send_multipart([b"", header(b"S")])  # as a REQ socket
        assert dealer.recv_multipart()[1][:2] == b"\x02S"
    assert len(client.statuses()) == 5


def test_a_value_whose_conversion_raises_is_reported_not_fatal(
    mission: Mission, client: GrootClient, caplog: pytest.LogCaptureFixture
) -> None:
    class Broken(dict[str, int]):
        def items(self) -> Any:
            raise RuntimeError("changed while it was read")

    mission.tree.variables["x"] = Broken()
    mission.tick()
    assert client.refusal(header(b"B"), b"Main") == "RuntimeError: changed while it was read"
    assert len(client.statuses()) == 5
    assert "could not be answered" in caplog.text


# --- ports and threads ----------------------------------------------------------------------------


@pytest.mark.parametrize("below", [0, 1])
def test_a_port_that_is_taken_is_reported_with_both_ports(
    publisher: GrootPublisher, port: int, below: int
) -> None:
    """Also if only the port of the notifications is taken."""
    wanted = port - below
    with (
        pytest.raises(InputError, match=rf"Groot2 needs ports {wanted} and {wanted + 1}"),
        GrootPublisher(wanted),
    ):
        pytest.fail("served without its ports")


def test_a_closed_publisher_frees_its_ports_and_its_thread(port: int) -> None:
    for _ in range(2):
        with GrootPublisher(port), GrootClient(port) as client:
            assert client.refusal(header(b"T")) == "no tree yet: the mission has not begun"
    assert not [item for item in threading.enumerate() if item.name == "groot2-publisher"]


def test_notifications_have_the_next_port(publisher: GrootPublisher, port: int) -> None:
    with socket.create_connection(("127.0.0.1", port + 1)) as raw:
        assert raw.recv(1) == b"\xff"  # a ZeroMQ greeting


def test_only_this_machine_is_served(publisher: GrootPublisher, port: int) -> None:
    """It is bound to the loopback interface: another address of this machine does not answer."""
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.2", port))


def test_ticking_and_answering_do_not_disturb_each_other(
    mission: Mission, client: GrootClient
) -> None:
    """While the tree ticks on one thread, all answers on the other are complete."""
    failures: list[BaseException] = []
    done = threading.Event()

    def ask() -> None:
        try:
            while not done.is_set():
                assert len(client.statuses()) == 5
                client.ask("r", b"start")
                client.boards("Main", "inside")
                client.transitions()
        except BaseException as error:  # noqa: BLE001  # reported by the thread of the test
            failures.append(error)

    asking = threading.Thread(target=ask)
    asking.start()
    for index in range(500):
        mission.tree.variables[f"v{index % 50}"] = index
        mission.tick()
        if index % 50 == 0:
            mission.tree.halt()
    done.set()
    asking.join()
    assert failures == []
