"""Compare the body of the drone without images with that of the twin, on the same commands.

    python -m benchmarks.fit_airframe
    python -m benchmarks.fit_airframe --profiles ideal --seeds 20
    python -m benchmarks.fit_airframe --side-frictions 1 1     # of boxes and walls, of movers

Both have the same autopilot, seed, wind and sensor errors. The table shows how far apart they are
over a manoeuvre, means over seeds, and the rise time (10 to 90 %) and overshoot of both. The last
manoeuvres have contacts: a box in the way, a mover that comes, motors cut in the air, a landing
across a box's edge.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from sim_bridge.plain.airframe import PlainBody
from sim_bridge.twin.body import Body, Motion
from sim_bridge.twin.gl import load_mujoco
from sim_bridge.twin.movers import MoverSpec
from sim_bridge.twin.objects import BoxSpec
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import GroundSpec, Scene, TakeOffSpec
from sim_bridge.twin.simulation import Simulation
from sim_bridge.twin.variation import start_pose
from uav_bt.types import Command, CutMotors, Hover, Land, MoveBy, Movement, TakeOff, Velocity

load_mujoco()  # before the modules below: MuJoCo selects its OpenGL backend when imported

from sim_bridge.twin.flying_body import FlyingBody  # noqa: E402  (after load_mujoco)
from sim_bridge.twin.model import build_model  # noqa: E402  (after load_mujoco)

Script = list[tuple[float, Movement]]  # each movement with its duration, s
AIRBORNE_S: Final = 8.0
OPEN: Final = Scene(
    name="open",
    ground=GroundSpec(size_m=(12.0, 12.0)),
    take_off=TakeOffSpec(position_m=(0.0, 0.0)),
)
BOXES: Final = Scene(
    name="boxes",
    ground=GroundSpec(size_m=(12.0, 12.0)),
    take_off=TakeOffSpec(position_m=(0.0, 0.0)),
    boxes=(
        BoxSpec(pattern=1, position_m=(1.0, 0.0), size_m=(0.4, 1.0, 2.0), yaw_deg=20.0),
        BoxSpec(pattern=2, position_m=(-1.0, 0.0), size_m=(0.5, 0.5, 0.5)),
    ),
)
WALKED: Final = Scene(
    name="walked",
    ground=GroundSpec(size_m=(12.0, 12.0)),
    take_off=TakeOffSpec(position_m=(0.0, 0.0)),
    movers=(MoverSpec(path_m=((4.0, 0.7), (-5.0, 0.7)), speed_mps=0.3),),
)


@dataclass(frozen=True)
class Manoeuvre:
    """Movements, and the quantity whose rise time and overshoot are shown."""

    script: Script
    quantity: Callable[[Motion], float] | None = None
    scene: Scene = OPEN
    take_off: bool = True  # whether the script begins in the air


MANOEUVRES: Final = {
    "take-off": Manoeuvre([(5.0, TakeOff())], lambda motion: motion.z_m, take_off=False),
    "velocity step": Manoeuvre([(3.0, Velocity(forward_mps=0.5))], lambda motion: motion.vx_mps),
    "velocity step, stop": Manoeuvre(
        [(3.0, Velocity(forward_mps=0.5, right_mps=0.3)), (3.0, Hover())], lambda motion: motion.x_m
    ),
    "MoveBy 1.5 m": Manoeuvre([(5.0, MoveBy(id=1, forward_m=1.5))], lambda motion: motion.x_m),
    "climb 0.6 m": Manoeuvre([(4.0, MoveBy(id=1, down_m=-0.6))], lambda motion: motion.z_m),
    "turn 90 degrees": Manoeuvre(
        [(4.0, MoveBy(id=1, yaw_rad=math.pi / 2))], lambda motion: -motion.yaw_rad
    ),
    "turn in flight": Manoeuvre([(6.0, Velocity(forward_mps=0.5, yaw_rate_radps=0.8))]),
    "landing": Manoeuvre([(6.0, Land())], lambda motion: motion.z_m),
    "into a box": Manoeuvre([(4.0, Velocity(forward_mps=0.5)), (2.0, Hover())], scene=BOXES),
    "a mover comes": Manoeuvre([(3.0, MoveBy(id=1, right_m=-0.5)), (8.0, Hover())], scene=WALKED),
    "motors cut": Manoeuvre([(2.0, CutMotors())]),
    "landing on an edge": Manoeuvre(
        [(4.0, MoveBy(id=1, forward_m=-0.72)), (6.0, Land())], scene=BOXES
    ),
}


def random_commands(seed: int) -> Manoeuvre:
    """Return 20 s of random velocities and movements."""
    draw = np.random.default_rng(seed)
    script: Script = []
    for number in range(10):
        x, y, z, turn = (float(value) for value in draw.uniform(-1.0, 1.0, 4))
        if draw.random() < 0.7:
            order: Movement = Velocity(
                forward_mps=0.7 * x, right_mps=0.5 * y, down_mps=0.1 * z, yaw_rate_radps=turn
            )
        else:
            order = MoveBy(id=number, forward_m=x, right_m=y, down_m=0.1 * z, yaw_rad=turn)
        script.append((2.0, order))
    return Manoeuvre(script)


def flown(manoeuvre: Manoeuvre, body: Body, profile: Profile, seed: int) -> list[Motion]:
    """Return the motion at each control step of a manoeuvre."""
    scene = manoeuvre.scene
    simulation = Simulation(scene, body, profile, seed, start_pose(scene, seed))
    start: Script = [(AIRBORNE_S, TakeOff())] if manoeuvre.take_off else []
    motions, end_s = [], 0.0
    for number, (duration_s, movement) in enumerate([*start, *manoeuvre.script]):
        end_s += duration_s
        while simulation.now_s < end_s - 1e-6:
            if round(100 * simulation.now_s) % 10 == 0:
                simulation.enqueue(Command(movement=movement))
            simulation.run_until(simulation.now_s + 0.01)
            if number >= len(start):
                motions.append(simulation.motion)
    return motions


def response(values: Iterable[float]) -> str:
    """Return rise time and overshoot of a quantity."""
    series = np.array(list(values))
    share = (series - series[0]) / (series[-1] - series[0])
    low, high = (int(np.argmax(share >= level)) for level in (0.1, 0.9))
    return f"{(high - low) / 100:.2f} s {max(0.0, share.max() - 1):.1%}"


def row(name: str, pairs: list[tuple[list[Motion], list[Motion]]], manoeuvre: Manoeuvre) -> str:
    """Return a line of the table: the differences, and the responses of the first seed."""
    off, tilt, turn = [], [], []
    for one, other in pairs:
        for a, b in zip(one, other, strict=True):
            off.append(math.dist((a.x_m, a.y_m, a.z_m), (b.x_m, b.y_m, b.z_m)))
            tilt.append(math.hypot(a.roll_rad - b.roll_rad, a.pitch_rad - b.pitch_rad))
            turn.append(abs(math.remainder(a.yaw_rad - b.yaw_rad, math.tau)))
    cells = [
        f"{1000 * np.mean(off):.3f} ({1000 * np.max(off):.3f})",
        *(f"{math.degrees(np.mean(each)):.3f}" for each in (tilt, turn)),
    ]
    shown, quantity = "-", manoeuvre.quantity
    if quantity is not None:
        shown = ", ".join(response(map(quantity, each)) for each in pairs[0])
    cells.append(shown)
    return f"| {name} | {' | '.join(cells)} |"


def main() -> None:
    """Print a table for each profile."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--profiles", nargs="+", default=["lab", "harsh"])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--side-frictions", type=float, nargs=2, metavar=("SOLID", "MOVER"))
    given = parser.parse_args()
    options = {"side_frictions": tuple(given.side_frictions)} if given.side_frictions else {}
    labs = {scene.name: build_model(scene, drawn=False) for scene in (OPEN, BOXES, WALKED)}
    for name in given.profiles:
        profile = Profile.named(name)
        lag_s = profile.thrust_lag_s
        print(
            f"\n| {name} | apart, mean (most), mm | tilt, deg | yaw, deg | twin, without images |"
        )
        print("|---|---|---|---|---|")
        for title in (*MANOEUVRES, "20 s of random commands"):
            pairs = []
            for seed in range(given.seeds):
                manoeuvre = MANOEUVRES.get(title) or random_commands(seed)
                twin = FlyingBody(labs[manoeuvre.scene.name], lag_s=lag_s)
                plain = PlainBody(manoeuvre.scene, lag_s=lag_s, **options)
                bodies: tuple[Body, Body] = twin, plain
                pairs.append(tuple(flown(manoeuvre, each, profile, seed) for each in bodies))
            print(row(title, pairs, manoeuvre), flush=True)


if __name__ == "__main__":
    main()
