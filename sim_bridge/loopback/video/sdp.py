"""How the stream is described to a client before it is set up.

Source: RFC 8866 (SDP), RFC 6184 section 8.2 (H.264), and what Parrot's libsdp and
libvideo-metadata read: `i=` of the medium is the name by which Olympe 8.5.0 looks for it, and a
session-wide `a=range:npt=now-` is an error to that parser, so that there is none.
"""

from __future__ import annotations

import base64

from sim_bridge.loopback.video.encoder import CLOCK_HZ, ParameterSets
from sim_bridge.loopback.video.rtp import PAYLOAD_TYPE


def describe(sets: ParameterSets, *, serial: str, host: str, session: int, control: str) -> str:
    """Return the SDP.

    Args:
        sets: the parameter sets of the H.264 stream.
        serial: the drone's serial number, which Olympe shows as the session's metadata.
        host: the server's numeric address.
        session: a number for this session.
        control: the medium's control URL, relative to the stream's.
    """
    family = "IP6" if ":" in host else "IP4"
    sprop = ",".join(base64.b64encode(unit).decode() for unit in (sets.sps, sets.pps))
    parameters = (
        "packetization-mode=1",
        f"profile-level-id={sets.profile_level_id}",
        f"sprop-parameter-sets={sprop}",
    )
    lines = (
        "v=0",
        f"o=- {session} 1 IN {family} {host}",
        "s=ANAFI",
        "i=ANAFI",
        f"c=IN {family} {host}",
        "t=0 0",
        "a=tool:uav_bt",
        "a=control:*",
        "a=X-com-parrot-maker:Parrot",
        "a=X-com-parrot-model:ANAFI",
        "a=X-com-parrot-model-id:0914",
        f"a=X-com-parrot-serial:{serial}",
        f"m=video 0 RTP/AVP {PAYLOAD_TYPE}",
        "i=Front camera",
        f"a=rtpmap:{PAYLOAD_TYPE} H264/{CLOCK_HZ}",
        f"a=fmtp:{PAYLOAD_TYPE} {';'.join(parameters)}",
        f"a=control:{control}",
        "a=X-com-parrot-default-media:1",
        "a=X-com-parrot-camera-type:front",
        "a=X-com-parrot-camera-spectrum:visible",
    )
    return "".join(f"{line}\r\n" for line in lines)
