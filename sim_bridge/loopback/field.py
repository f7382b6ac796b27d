"""The open field: where a served drone flies unless it is given a lab.

Scripts written for the ANAFI move it by ten metres and more, at some metres a second. The lab's
room is ten metres wide, so the field is the lab without boxes, walls and ceiling, on a wide floor,
and its drone is as quick as one outdoors.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from sim_bridge.twin.gl import load_mujoco
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import Helipad, Scene, TakeOffSpec

load_mujoco()  # before the modules below do: how it draws is settled at its import

import mujoco  # noqa: E402  (after load_mujoco)

from sim_bridge.twin.model import LabModel, build_model  # noqa: E402  (after load_mujoco)

__all__ = ["FIELD", "FIELD_NAME", "build_field", "field_profile"]

FIELD_NAME: Final = "field"
FIELD: Final = Scene(
    name=FIELD_NAME,
    helipad=Helipad(position_m=(0.0, 1.5)),
    take_off=TakeOffSpec(position_m=(0.0, 0.0)),
)

_HALF_M: Final = 1000.0  # of the floor, each way
_UNSEEN_GROUP: Final = 5  # not drawn by default


def field_profile(profile: Profile) -> Profile:
    """Return a profile with the pace of an ANAFI outdoors.

    The speed is what the twin's autopilot still follows closely; the ANAFI itself reaches 15 m/s.

    Args:
        profile: its delays and imperfections are kept.
    """
    return replace(
        profile,
        max_speed_mps=4.0,
        max_climb_mps=3.0,
        max_acceleration_mps2=3.0,
        max_climb_acceleration_mps2=3.0,
        max_yaw_rate_radps=3.0,
        max_yaw_acceleration_radps2=6.0,
    )


def build_field() -> LabModel:
    """Compile the field: nothing to fly into but the ground and the pad."""
    lab = build_model(FIELD)
    model = lab.model
    for index in range(model.ngeom):
        geom = model.geom(index)
        name = geom.name.removesuffix("/seen")
        if name == "ceiling" or name.startswith("wall-"):
            geom.contype = geom.conaffinity = 0
            geom.group = _UNSEEN_GROUP
        elif geom.name == "floor":
            geom.size[:2] = _HALF_M
            model.geom_rbound[index] = 2.0 * _HALF_M
            model.geom_aabb[index, 3:5] = _HALF_M
    # The tree of bounding boxes was made for the small floor.
    model.opt.disableflags |= np.int32(mujoco.mjtDisableBit.mjDSBL_MIDPHASE.value)
    return lab
