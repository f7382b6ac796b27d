"""How the stream is described to a client before it is set up.

Source: RFC 8866 (SDP), RFC 6184 section 8.2 (H.264), and what Parrot's libsdp and
libvideo-metadata read: `i=` of the medium is the name by which Olympe 8.5.0 looks for it, and a
session-wide `a=range:npt=now-` is an error to that parser, so that there is none.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass

from sim_bridge.loopback.video.encoder import CLOCK_HZ, ParameterSets
from sim_bridge.loopback.video.rtp import PAYLOAD_TYPE
from uav_bt.errors import InputError

__all__ = ["StreamIdentity", "describe"]


@dataclass(frozen=True, kw_only=True)
class StreamIdentity:
    """The sender of the video; Olympe shows it as the session's metadata.

    Raises:
        InputError: a name is not one line of 1 to 64 bytes.
    """

    name: str = "ANAFI"
    serial: str = "PI040416AA0B000000"  # 18 characters, as Parrot's serials have
    maker: str = "Parrot"
    model: str = "ANAFI"
    model_id: str = "0914"  # ANAFI 4K
    software: str = "uav_bt"
    medium: str = "Front camera"  # by this name Olympe 8.5.0 chooses it

    def __post_init__(self) -> None:
        for text in vars(self).values():
            if not text or not text.isprintable() or len(text.encode()) > 64:
                raise InputError(
                    f"names in the video's description are one line of 1 to 64 bytes, got {text!r}"
                )


def describe(
    identity: StreamIdentity, sets: ParameterSets, *, host: str, session: int, control: str
) -> str:
    """Return the SDP.

    Args:
        identity: the sender.
        sets: the parameter sets of the H.264 stream.
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
        f"s={identity.name}",
        f"i={identity.name}",
        f"c=IN {family} {host}",
        "t=0 0",
        f"a=tool:{identity.software}",
        "a=control:*",
        f"a=X-com-parrot-maker:{identity.maker}",
        f"a=X-com-parrot-model:{identity.model}",
        f"a=X-com-parrot-model-id:{identity.model_id}",
        f"a=X-com-parrot-serial:{identity.serial}",
        f"m=video 0 RTP/AVP {PAYLOAD_TYPE}",
        f"i={identity.medium}",
        f"a=rtpmap:{PAYLOAD_TYPE} H264/{CLOCK_HZ}",
        f"a=fmtp:{PAYLOAD_TYPE} {';'.join(parameters)}",
        f"a=control:{control}",
        "a=X-com-parrot-default-media:1",
        "a=X-com-parrot-camera-type:front",
        "a=X-com-parrot-camera-spectrum:visible",
    )
    return "".join(f"{line}\r\n" for line in lines)
