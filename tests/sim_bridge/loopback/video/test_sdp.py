"""The stream's description."""

from __future__ import annotations

import base64

from sim_bridge.loopback.video.encoder import ParameterSets
from sim_bridge.loopback.video.sdp import describe

SETS = ParameterSets(sps=b"\x67\x42\xc0\x1f\xda", pps=b"\x68\xce")


def lines(serial: str = "PI9") -> list[str]:
    text = describe(SETS, serial=serial, host="127.0.0.1", session=42, control="stream=0")
    assert text.endswith("\r\n")
    return text.removesuffix("\r\n").split("\r\n")


def test_what_the_standard_asks_for_comes_in_its_order() -> None:
    """v, o, s, i, c, t, attributes; then the medium's m, i, attributes (RFC 8866, section 5)."""
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
    text = describe(SETS, serial="PI9", host="::1", session=1, control="stream=0")
    assert "c=IN IP6 ::1\r\n" in text
