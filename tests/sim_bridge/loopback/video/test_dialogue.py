"""Answers to a client, including the description of the stream."""

from __future__ import annotations

import base64

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_bridge.loopback.video.dialogue import Dialogue, describe
from sim_bridge.loopback.video.encoder import ParameterSets
from sim_bridge.loopback.video.rtsp_message import Request, RtspError
from sim_bridge.loopback.video.transport import Transport
from tests.sim_bridge.loopback.video.video_client import Answer, parse_answer, seeded

URL = "rtsp://127.0.0.1:8554/live"
UDP = "RTP/AVP;unicast;client_port=5000-5001"


class Stage:
    """Session actions that record their calls."""

    def __init__(self) -> None:
        self.done: list[object] = []
        self.full = False

    def description(self) -> str:
        return "v=0\r\n"

    def set_up(self, transport: Transport) -> str:
        if self.full:
            raise RtspError(453, "full")
        self.done.append(transport)
        return "RTP/AVP;unicast;client_port=5000-5001;server_port=6000-6001"

    def play(self) -> tuple[int, int]:
        self.done.append("play")
        return 17, 90_000

    def pause(self) -> None:
        self.done.append("pause")

    def tear_down(self) -> None:
        self.done.append("tear down")


class Client:
    """Sends requests in turn."""

    def __init__(self) -> None:
        self.stage = Stage()
        self._dialogue = Dialogue(self.stage, seeded(1))
        self._session: dict[str, str] = {}

    def ask(self, method: str, url: str = URL, body: bytes = b"", **headers: str) -> Answer:
        given = {"cseq": "5", **self._session, **headers}
        request = Request(method=method, url=url, headers=given, body=body)
        found = parse_answer(self._dialogue.reply(request))
        if "session" in found.headers:
            self._session = {"session": found.headers["session"].partition(";")[0]}
        return found

    def set_up(self) -> Answer:
        return self.ask("SETUP", f"{URL}/stream=0", transport=UDP)


@pytest.fixture
def client() -> Client:
    return Client()


def test_a_whole_visit(client: Client) -> None:
    assert "PLAY" in client.ask("OPTIONS").headers["public"]
    described = client.ask("DESCRIBE", accept="application/sdp")
    assert described.headers["content-base"] == f"{URL}/"
    assert described.headers["content-type"] == "application/sdp"
    assert described.body == b"v=0\r\n"
    setup = client.set_up()
    assert setup.headers["session"].endswith(";timeout=60")
    assert "server_port=6000-6001" in setup.headers["transport"]
    assert client.ask("PLAY").headers["rtp-info"] == f"url={URL}/stream=0;seq=17;rtptime=90000"
    assert client.ask("GET_PARAMETER").status == 200
    assert client.ask("PAUSE").status == 200
    assert client.ask("PLAY").status == 200
    assert client.ask("TEARDOWN").status == 200
    played = ["play", "pause", "play", "tear down"]
    assert client.stage.done == [Transport(ports=(5000, 5001)), *played]


@pytest.mark.parametrize("method", ["PLAY", "PAUSE", "TEARDOWN"])
def test_nothing_is_played_before_setup_or_after_teardown(client: Client, method: str) -> None:
    assert client.ask(method, session="0").status == 454
    client.set_up()
    client.ask("TEARDOWN")
    assert client.ask(method).status == 454
    assert client.stage.done[1:] == ["tear down"]


@pytest.mark.parametrize("method", ["PLAY", "PAUSE", "TEARDOWN", "GET_PARAMETER", "SETUP"])
def test_another_session_is_not_touched(client: Client, method: str) -> None:
    client.set_up()
    assert client.ask(method, session="1234", transport=UDP).status == 454
    assert len(client.stage.done) == 1


def test_the_transport_cannot_be_changed_while_playing(client: Client) -> None:
    client.set_up()
    client.ask("PLAY")
    assert client.set_up().status == 455
    client.ask("PAUSE")
    assert client.set_up().status == 200


@pytest.mark.parametrize(
    ("method", "url", "headers", "status"),
    [
        ("DESCRIBE", "rtsp://127.0.0.1/other", {}, 404),
        ("DESCRIBE", "http://127.0.0.1/live", {}, 404),
        ("DESCRIBE", "rtsp://[/live", {}, 400),
        ("DESCRIBE", URL, {"accept": "text/html"}, 406),
        ("DESCRIBE", URL, {"cseq": "one"}, 400),
        ("DESCRIBE", URL, {"require": "implicit-play"}, 551),
        ("SETUP", URL, {"transport": "RTP/SAVP;unicast;client_port=1-2"}, 461),
        ("SETUP", URL, {}, 461),
        ("ANNOUNCE", URL, {}, 405),
        ("RECORD", URL, {}, 405),
        ("FLY", URL, {}, 501),
    ],
)
def test_a_wrong_request_gets_one_clear_refusal(
    client: Client, method: str, url: str, headers: dict[str, str], status: int
) -> None:
    found = client.ask(method, url, **headers)
    assert found.status == status
    assert found.headers["content-type"] == "text/plain"
    assert found.body.endswith(b"\n")
    assert client.stage.done == []


WORDS = ["RTP/AVP", "TCP", "unicast", "client_port=", "interleaved=", "1-2", "65536", ";", ",", "="]


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["OPTIONS", "DESCRIBE", "SETUP", "PLAY", "PAUSE", "TEARDOWN", "X"]),
            st.sampled_from([URL, f"{URL}/stream=0", "*", "rtsp://", "rtsp://[x]/live"])
            | st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=20),
            st.lists(st.sampled_from(WORDS), max_size=8).map("".join) | st.just(UDP),
            st.sampled_from(["", "0"]) | st.text(max_size=5),
        ),
        max_size=8,
    )
)
def test_any_requests_in_any_order_are_answered(asked: list[tuple[str, str, str, str]]) -> None:
    client = Client()
    for method, url, transport, session in asked:
        given_headers = {"transport": transport} | ({"session": session} if session else {})
        assert client.ask(method, url, **given_headers).status in {200, *range(400, 552)}


def test_unknown_parameters_are_answered_as_unknown(client: Client) -> None:
    assert client.ask("GET_PARAMETER", body=b"rate").status == 451


def test_options_of_the_server_as_a_whole_are_listed(client: Client) -> None:
    assert client.ask("OPTIONS", "*").status == 200


def test_a_full_house_leaves_no_session(client: Client) -> None:
    client.stage.full = True
    assert client.set_up().status == 453
    assert client.ask("PLAY").status == 454


def test_every_client_gets_a_session_of_its_own() -> None:
    random = seeded(1)
    names = set()
    for _ in range(3):
        dialogue = Dialogue(Stage(), random)
        request = Request(method="SETUP", url=URL, headers={"cseq": "1", "transport": UDP})
        names.add(parse_answer(dialogue.reply(request)).headers["session"])
    assert len(names) == 3


SETS = ParameterSets(sps=b"\x67\x42\xc0\x1f\xda", pps=b"\x68\xce")


def lines(serial: str = "PI9") -> list[str]:
    text = describe(SETS, serial=serial, host="127.0.0.1", session=42)
    assert text.endswith("\r\n")
    return text.removesuffix("\r\n").split("\r\n")


def test_what_the_standard_asks_for_comes_in_its_order() -> None:
    """v, o, s, i, c, t, attributes; then m, i, attributes of the medium (RFC 8866, section 5)."""
    order = "".join(line[0] for line in lines())
    session, medium = order.split("m")
    assert session.rstrip("a") == "vosict"
    assert medium.rstrip("a") == "i"


def test_the_stream_is_h264_with_its_parameters() -> None:
    found = lines()
    assert "m=video 0 RTP/AVP 96" in found
    assert "a=rtpmap:96 H264/90000" in found
    sprop = ",".join(base64.b64encode(unit).decode() for unit in (SETS.sps, SETS.pps))
    assert (
        "a=fmtp:96 packetization-mode=1;profile-level-id=42C01F;"
        f"sprop-parameter-sets={sprop}" in found
    )
    assert found.count("a=control:*") == found.count("a=control:stream=0") == 1


def test_olympe_finds_the_medium_by_its_name() -> None:
    found = lines()
    assert found[found.index("m=video 0 RTP/AVP 96") + 1] == "i=Front camera"


def test_no_range_is_given_which_parrots_parser_refuses() -> None:
    assert not any(line.startswith("a=range") for line in lines())


def test_the_serial_number_is_in_it() -> None:
    assert "a=X-com-parrot-serial:PI9" in lines(serial="PI9")


def test_an_ipv6_address_is_called_one() -> None:
    text = describe(SETS, serial="PI9", host="::1", session=1)
    assert "c=IN IP6 ::1\r\n" in text
