"""The Groot2 publisher, asked by a client over a real connection, and missions that it watches."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
import zmq

from tests.uav_bt.groot import groot_world
from tests.uav_bt.groot.groot_world import HEIGHT, GrootClient, free_ports, read_log
from tests.worlds.trees import leaf, tree_file
from uav_bt import app, plugins
from uav_bt.clock import ManualClock
from uav_bt.errors import InputError
from uav_bt.groot import watched_live
from uav_bt.groot.watch import MAX_RECORDED, GrootPublisher, TreeWatch
from uav_bt.mission.tick import TickRecord
from uav_bt.testing import ScriptedDrone
from uav_bt.tree import Status

INNER = f'<BehaviorTree ID="Inner">{leaf("in", "RS")}</BehaviorTree>'
BODY = f"""
<Sequence name="all">
  {leaf("first", "S")}
  <SubTree ID="Inner" name="inside" amount="3"/>
  {leaf("last", "FR")}
</Sequence>"""


class Mission:
    """A running tree with a publisher."""

    def __init__(self, publisher: GrootPublisher) -> None:
        self.clock = ManualClock()
        self.context = groot_world.make_context(self.clock)
        self.tree = groot_world.make_tree(BODY, INNER)
        self.tree.setup(self.context)
        self.watch = TreeWatch(self.tree, self.context, publisher=publisher)

    def tick(self) -> None:
        self.tree.tick()
        self.watch.on_tick()
        self.clock.advance(0.1)


@pytest.fixture
def port() -> int:
    return groot_world.free_ports()


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


def test_the_tree_is_sent_with_numbers_and_paths(
    publisher: GrootPublisher, mission: Mission, client: GrootClient
) -> None:
    """A tree keeps its id, and another one has another."""
    root = client.tree()
    assert {tree.get("ID"): tree.get("_fullpath") for tree in root.iter("BehaviorTree")} == {
        "Main": "",
        "Inner": "inside",
    }
    uids = {each.get("name"): each.get("_uid") for each in root.iter() if each.get("_uid")}
    assert uids == {"all": "1", "first": "2", "inside": "3", "in": "4", "last": "5"}
    assert root.find("TreeNodesModel/Action[@ID='Scripted']/input_port[@name='script']") is not None
    ids = {client.ask(type_)[0] for type_ in "TSt"}
    Mission(publisher)
    assert (len(ids), client.ask("S")[0] in ids) == (1, False)


def test_statuses_tell_what_an_idle_node_was(mission: Mission, client: GrootClient) -> None:
    """Running is 1, success 2, failure 3; newly idle is 10 more than the former status."""
    told = [[*client.statuses().values()]]
    for _ in range(3):
        mission.tick()
        told.append([*client.statuses().values()])
    mission.tree.halt()
    mission.watch.finish()
    told.append([*client.statuses().values()])
    assert told == [
        [0, 0, 0, 0, 0],
        [1, 2, 1, 1, 0],
        [13, 12, 12, 12, 13],
        [1, 2, 2, 12, 1],
        [11, 12, 12, 12, 11],
    ]


def test_blackboards_come_by_the_names_of_the_trees(mission: Mission, client: GrootClient) -> None:
    """As at the end of a tick. Main includes the mission's board; unknown names are omitted."""
    mission.tree.variables["count"] = 7
    mission.context.board.write(HEIGHT, 1.5)
    mission.tick()
    mission.tree.variables["late"] = 1  # in the next tick
    assert client.boards("Main", "inside", "nowhere") == {
        "Main": {"count": 7, "@height_m": 1.5},
        "inside": {"amount": 3},
    }
    assert client.boards("") == {}


def test_transitions_are_recorded_when_asked_for(mission: Mission, client: GrootClient) -> None:
    mission.tick()  # before the first request
    assert client.ask("r", b"start")[1] == [b"0"]  # the time of the last tick, microseconds
    assert client.transitions() == []
    mission.tick()
    ended = [(4, 2), (3, 2), (4, 0), (5, 3), (2, 0), (3, 0), (5, 0), (1, 3), (1, 0)]
    assert client.transitions() == [(100_000, *item) for item in ended]
    mission.tick()
    assert client.ask("r", b"stop")[1] == []
    mission.tick()
    assert {time for time, _, _ in client.transitions()} == {200_000}
    client.ask("r", b"start")  # a recording that nobody fetches stays bounded
    for _ in range(MAX_RECORDED // 3):  # each leaves at least three transitions
        mission.tree.tick()
        mission.tree.halt()
    mission.watch.on_tick()
    assert len(client.transitions()) == MAX_RECORDED


@pytest.mark.parametrize(
    ("frames", "words"),
    [
        ([b""], "a header of 6 bytes and at most one part more, got parts of [0] bytes"),
        ([header(b"T") + b"!"], "got parts of [7] bytes"),
        ([header(b"T", protocol=1)], "expected protocol 2, got 1"),
        ([header(b"Z")], "request not recognized: type 90"),
        ([header(b"T"), b"", b""], "got parts of [6, 0, 0] bytes"),
        ([header(b"r")], "'start' or 'stop', got ''"),
        ([header(b"r"), b"faster"], "'start' or 'stop', got 'faster'"),
        *(([header(bytes([one])), b"{}"], f"changed (request '{one:c}')") for one in b"IRDAXUN"),
    ],
)
def test_a_bad_request_is_answered_with_the_reason(
    mission: Mission, client: GrootClient, frames: list[bytes], words: str
) -> None:
    assert words in client.refusal(*frames)
    assert len(client.statuses()) == 5


def test_noise_on_the_port_is_survived(port: int, mission: Mission, client: GrootClient) -> None:
    """A client of another kind gets no answer, nor does a request that is too large."""
    noises = (
        b"GET / HTTP/1.1\r\n\r\n" + bytes(range(256)) * 10,
        b"\xff\0\0\0\0\0\0\0\x01\x7f",  # start of a ZeroMQ greeting
        b"\x01\0\x02\0x" * 50,  # frames of the oldest ZeroMQ
    )
    for noise in noises * 5:
        with socket.create_connection(("127.0.0.1", port)) as raw:
            raw.sendall(noise)
        assert len(client.statuses()) == 5
    with zmq.Context() as context, context.socket(zmq.DEALER) as dealer:
        dealer.setsockopt(zmq.LINGER, 0)
        dealer.setsockopt(zmq.RCVTIMEO, 5000)
        dealer.connect(f"tcp://127.0.0.1:{port}")
        dealer.send_multipart([header(b"S")])
        dealer.send_multipart([header(b"S"), b""])
        dealer.send_multipart([b"", header(b"S")])  # as a REQ socket
        assert dealer.recv_multipart()[1][:2] == b"\x02S"
        dealer.send_multipart([b"", b"x" * 1_000_000])
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


# --- ports ----------------------------------------------------------------------------------------


def test_ports_are_taken_on_this_machine_only_and_freed(port: int) -> None:
    """The next port is for notifications; other addresses of this machine do not answer."""
    for _ in range(2):
        with GrootPublisher(port), GrootClient(port) as client:
            assert client.refusal(header(b"T")) == "no tree yet: the mission has not begun"
            with socket.create_connection(("127.0.0.1", port + 1)) as raw:
                assert raw.recv(1) == b"\xff"  # a ZeroMQ greeting
            with pytest.raises(OSError, match="refused"):
                socket.create_connection(("127.0.0.2", port))
            for wanted in (port, port - 1):
                with (
                    pytest.raises(InputError, match=f"needs ports {wanted} and {wanted + 1}"),
                    GrootPublisher(wanted),
                ):
                    pytest.fail("served without its ports")
    assert not [item for item in threading.enumerate() if item.name == "groot2-publisher"]


# --- a mission that is watched --------------------------------------------------------------------


@dataclass(frozen=True)
class Scripted:
    """A kind of drone by name."""

    def create(self) -> ScriptedDrone:
        return ScriptedDrone()


HOP = '<Sequence><TakeOff height_m="1.0"/><HoverFor seconds="0.5"/><Land/></Sequence>'


@pytest.fixture
def hop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the file of a short mission; the drone `scripted` flies it."""
    found = plugins.load

    def load(group: str, name: str) -> object:
        if (group, name) == (plugins.DRONES, "scripted"):
            return Scripted
        return found(group, name)

    monkeypatch.setattr(plugins, "load", load)
    return tree_file(tmp_path, HOP)


SCRIPTED = app.FlightOptions(drone="scripted", judge=app.JudgeConfig(land_on=app.LandOn.ANY))


def following(watch: Callable[..., Any]) -> app.Listeners:
    return lambda flight: watch(flight.mission, flight.context)


def test_a_flight_is_logged_from_its_first_tick_to_its_end(hop: Path, tmp_path: Path) -> None:
    path = tmp_path / "flight.btlog"
    with watched_live(btlog=path) as listeners:
        report = app.fly(hop, SCRIPTED, listeners=[following(listeners)])
    xml, _, transitions = read_log(path)
    root = ET.fromstring(xml)  # noqa: S314  # written by this test
    names = {int(node.attrib["_uid"]): node.attrib["name"] for node in root.iterfind(".//*[@_uid]")}
    changes: dict[str, list[Status]] = {}
    for _, uid, status in transitions:
        changes.setdefault(names[uid], []).append(status)
    assert list(changes) == ["Sequence", "TakeOff", "HoverFor", "Land"]
    once = [Status.RUNNING, Status.SUCCESS, Status.IDLE]
    assert all(statuses == once for statuses in changes.values())
    assert report.duration_s is not None
    assert transitions[-1][0] / 1e6 == pytest.approx(report.duration_s, abs=0.2)


def test_groot2_sees_the_flight_while_it_goes_on(hop: Path) -> None:
    """A client between ticks gets one running branch, and the board of a drone in the air."""
    seen: list[dict[int, int]] = []
    heights: list[float] = []
    port = free_ports()
    with watched_live(groot=port) as watch, GrootClient(port) as client:

        class Asking:
            def on_tick(self, _: TickRecord) -> None:
                seen.append(client.statuses())
                heights.append(client.boards("Main")["Main"]["@height_above_ground_m"])

        asking = [following(watch), lambda _: [Asking()]]
        report = app.fly(hop, SCRIPTED, listeners=asking)
    assert len(seen) == report.ticks
    assert seen[0] == {1: 1, 2: 1, 3: 0, 4: 0}
    assert any(statuses == {1: 1, 2: 2, 3: 1, 4: 0} for statuses in seen)
    assert seen[-1] == {1: 12, 2: 12, 3: 12, 4: 12}
    assert max(heights) == pytest.approx(1.0, abs=0.2)
