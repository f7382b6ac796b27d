"""Rigid body of the simulated drone in MuJoCo.

Single rotors are not modelled. The body gets the force that a quadrotor with an attitude loop would
produce: the demanded acceleration behind a first-order lag. It tilts as that force requires.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from sim_bridge.twin.body import Motion, lag_gain
from sim_bridge.twin.builder import HULL_MASS_KG, STEPS_PER_CONTROL, LabModel
from sim_bridge.twin.gl import mujoco
from uav_bt.types import MoverState, rotate
from uav_bt.types.pose import clamp

_GRAVITY_MPS2: Final = 9.81
_TILT_RADPS: Final = 18.0  # bandwidth of the attitude loop; faster than the thrust
_FAR_M: Final = 100.0  # larger than any room

Vector = tuple[float, float, float]
"""Accelerations along the world's axes, m/s2."""


class FlyingBody:
    """The drone's body in MuJoCo; `lag_s` is that from demanded to real acceleration."""

    def __init__(self, lab: LabModel, *, lag_s: float) -> None:
        self.lab, self._model = lab, lab.model
        self._data: Any = mujoco.MjData(lab.model)
        self._position = self._data.qpos[:7]
        self._velocity = self._data.qvel[:6]
        self._wrench = self._data.xfrc_applied[lab.hull_body]
        self._inertia = [float(value) for value in lab.model.body_inertia[lab.hull_body]]
        self._hull = lab.hull_geom
        self._obstacles = lab.obstacle_geoms
        self._names = [lab.contact_name(index) for index in range(lab.model.ngeom)]
        self._gain = lag_gain(lag_s)
        self._thrust_mps2 = [0.0, 0.0, 0.0]  # acceleration by the rotors, behind the lag

    def place(self, x_m: float, y_m: float, z_m: float, yaw_rad: float) -> None:
        """Place the body at a pose, at rest and level."""
        half = yaw_rad / 2.0
        self._position[:] = (x_m, y_m, z_m, math.cos(half), 0.0, 0.0, math.sin(half))
        self._velocity[:] = 0.0
        self._thrust_mps2[:] = (0.0, 0.0, 0.0)
        mujoco.mj_forward(self._model, self._data)

    def motion(self) -> Motion:
        """Return the present motion."""
        x, y, z, qw, qx, qy, qz = self._position.tolist()
        vx, vy, vz, _, wy, wz = self._velocity.tolist()
        roll = math.atan2(2.0 * (qw * qx + qy * qz), 1.0 - 2.0 * (qx * qx + qy * qy))
        yaw = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        pitch_down = math.asin(clamp(2.0 * (qw * qy - qz * qx), 1.0))
        yaw_rate = (wy * math.sin(roll) + wz * math.cos(roll)) / max(0.1, math.cos(pitch_down))
        return Motion(
            x_m=x,
            y_m=y,
            z_m=z,
            vx_mps=vx,
            vy_mps=vy,
            vz_mps=vz,
            roll_rad=roll,
            pitch_rad=-pitch_down,
            yaw_rad=yaw,
            yaw_rate_radps=yaw_rate,
        )

    def fly(
        self, motion: Motion, demand_mps2: Vector, yaw_demand_radps2: float, wind_mps2: Vector
    ) -> None:
        """Set the forces of the next control step; the demand is without gravity."""
        thrust, gain = self._thrust_mps2, self._gain
        for axis in range(3):
            thrust[axis] += gain * (demand_mps2[axis] - thrust[axis])
        ax, ay, az = thrust
        # The rotors push along the body's up axis, so a horizontal acceleration needs a tilt.
        lift = max(_GRAVITY_MPS2 + az, 1.0)
        forward, left = rotate(ax, ay, -motion.yaw_rad)
        want_roll = -math.atan2(left, math.hypot(forward, lift))
        want_pitch = -math.atan2(forward, lift)
        wx, wy = self._velocity[3:5].tolist()
        stiff, damp = _TILT_RADPS**2, 2.0 * _TILT_RADPS
        torque_x = self._inertia[0] * (stiff * (want_roll - motion.roll_rad) - damp * wx)
        torque_y = self._inertia[1] * (stiff * (motion.pitch_rad - want_pitch) - damp * wy)
        self._wrench[:] = (
            HULL_MASS_KG * (ax + wind_mps2[0]),
            HULL_MASS_KG * (ay + wind_mps2[1]),
            HULL_MASS_KG * (az + _GRAVITY_MPS2 + wind_mps2[2]),
            *rotate(torque_x, torque_y, motion.yaw_rad),
            self._inertia[2] * yaw_demand_radps2,
        )

    def drop(self) -> None:
        """Remove all forces: the motors are off."""
        self._thrust_mps2[:] = (0.0, 0.0, 0.0)
        self._wrench[:] = 0.0

    def place_movers(self, movers: Sequence[MoverState]) -> None:
        """Place the movers, in the order of the scene."""
        for row, mover in enumerate(movers):
            self._data.mocap_pos[row, :2] = mover.pose.x_m, mover.pose.y_m

    def advance(self) -> None:
        """Advance the physics by one control step."""
        mujoco.mj_step(self._model, self._data, nstep=STEPS_PER_CONTROL)

    def contacts(self) -> tuple[str, ...]:
        """Return the names of the objects that the hull touches now, sorted."""
        count, hull = self._data.ncon, self._hull
        if not count:
            return ()
        pairs = self._data.contact.geom[:count].tolist()
        others = {self._names[a if b == hull else b] for a, b in pairs if hull in (a, b)}
        return tuple(sorted(others))

    def clearance_m(self) -> float:
        """Return the distance from the hull to the nearest obstacle; inf without any."""
        model, data, hull = self._model, self._data, self._hull
        mujoco.mj_kinematics(model, data)
        nearest = _FAR_M
        for geom in self._obstacles:
            nearest = min(nearest, mujoco.mj_geomDistance(model, data, hull, geom, nearest, None))
        return max(0.0, nearest) if self._obstacles else math.inf
