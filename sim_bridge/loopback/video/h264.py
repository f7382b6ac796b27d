"""H.264 as a stream of bytes: NAL units and what their first bytes say (ITU-T H.264, annex B)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from uav_bt.errors import DroneError

__all__ = ["IDR", "PPS", "SPS", "ParameterSets", "find_parameter_sets", "nal_type", "split_nals"]

IDR: Final = 5  # a slice of a picture that needs no other
SPS: Final = 7
PPS: Final = 8

_START_CODE: Final = b"\x00\x00\x01"


def split_nals(stream: bytes) -> tuple[bytes, ...]:
    """Return the NAL units between start codes, without those.

    A unit never ends with a zero byte; zeros there belong to the next, longer start code.
    """
    units = (unit.rstrip(b"\x00") for unit in stream.split(_START_CODE)[1:])
    return tuple(unit for unit in units if unit)


def nal_type(unit: bytes) -> int:
    """Return a NAL unit's type."""
    return unit[0] & 0x1F


@dataclass(frozen=True, kw_only=True)
class ParameterSets:
    """What a decoder has to know before the first picture."""

    sps: bytes
    pps: bytes

    @property
    def profile_level_id(self) -> str:
        """Profile, constraints and level as the SDP names them."""
        return self.sps[1:4].hex().upper()


def find_parameter_sets(nals: tuple[bytes, ...]) -> ParameterSets:
    """Return the parameter sets of a key frame.

    Raises:
        DroneError: there are none.
    """
    sps = next((unit for unit in nals if nal_type(unit) == SPS), None)
    pps = next((unit for unit in nals if nal_type(unit) == PPS), None)
    if sps is None or pps is None:
        kinds = ", ".join(str(nal_type(unit)) for unit in nals) or "none"
        raise DroneError(f"expected NAL units 7 and 8 in a key frame, got types {kinds}")
    return ParameterSets(sps=sps, pps=pps)
