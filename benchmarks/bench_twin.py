"""What the twin costs: pictures, truth, physics, and flights as multiples of real time.

Run from the repository: ``python benchmarks/bench_twin.py``. Times are medians; the machine should
be idle, because drawing without a GPU uses all cores.
"""

from __future__ import annotations

import argparse
import math
import os
import resource
import statistics
import time
from collections.abc import Callable

import numpy as np

from sim_bridge.twin import create_drone
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.drone import TwinDrone
from sim_bridge.twin.gl import choose_gl
from sim_bridge.twin.model import build_model
from sim_bridge.twin.optics import Optics
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.referee import TwinReferee
from sim_bridge.twin.render import Renderer
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import sample_flight_poses
from uav_bt.protocols import DroneOptions
from uav_bt.types import Command, GimbalTo, MoveBy, TakeOff

SIZES = ((1152, 648), (640, 360), (320, 180), (224, 112))


def median_ms(work: Callable[[int], object], count: int) -> float:
    """Return the median time of `count` calls, milliseconds."""
    times = []
    for index in range(count):
        start = time.perf_counter()
        work(index)
        times.append(time.perf_counter() - start)
    return 1e3 * statistics.median(times)


def bench_pictures(scene_name: str, count: int, samples: int) -> None:
    """Print the time of every kind of picture at several sizes."""
    scene = load_scene(scene_name)
    poses = sample_flight_poses(scene, np.random.default_rng(0), count)
    print(f"\n{samples}x anti-aliasing    RGB     ids   ids+depth   lens and noise  [ms]")
    with Renderer(build_model(scene), samples=samples) as renderer:
        for size in SIZES:
            bench_size(renderer, poses, *size)


def bench_size(renderer: Renderer, poses: list[CameraPose], width: int, height: int) -> None:
    """Print one row: the time of every kind of picture at one size."""
    count = len(poses)
    rgb = median_ms(lambda k: renderer.rgb(poses[k], width, height), count)
    ids = median_ms(lambda k: renderer.class_ids(poses[k], width, height), count)
    both = median_ms(lambda k: renderer.ids_and_depth(poses[k], width, height), count)
    image = renderer.rgb(poses[0], width, height)
    optics = Optics(Profile.named("lab"), width, height, 0)
    lens = median_ms(lambda k: optics.spoil(image, k, 1.01), count)
    print(f"{width:9d}x{height:<4d} {rgb:8.2f} {ids:7.2f} {both:9.2f} {lens:12.2f}")


def bench_flight(scene_name: str, size: tuple[int, int], *, look: bool, mask: bool) -> None:
    """Print what a tick of a flight costs and how much faster than real time that is."""
    drone = create_drone(DroneOptions(scene=scene_name, image_size_px=size))
    drone.connect()
    ticks = 300

    def tick(index: int) -> None:
        drone.send(Command(movement=_order(index), gimbal=GimbalTo(pitch_rad=-0.47)))
        drone.clock.sleep_until(0.1 * (index + 1))
        if look:
            frame = drone.observe().frame
            if mask and frame is not None:
                _referee(drone).class_ids(frame, 224, 112)
        _referee(drone).truth()

    cost = median_ms(tick, ticks)
    drone.disconnect()
    what = f"RGB {size[0]}x{size[1]}" if look else "no pictures"
    what += " + exact mask 224x112" if mask else ""
    print(f"{what:38s} {cost:6.2f} ms a tick, {100.0 / cost:5.1f} x real time")


def _order(tick: int) -> TakeOff | MoveBy:
    if tick < 45:
        return TakeOff()
    return MoveBy(id=tick // 25, forward_m=0.3, yaw_rad=math.pi / 3)


def _referee(drone: TwinDrone) -> TwinReferee:
    referee = drone.referee
    if referee is None:
        raise RuntimeError("the twin lost its referee")
    return referee


def main() -> None:
    """Run all measurements."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", default="train-a")
    parser.add_argument("--count", type=int, default=84, help="pictures of each kind")
    options = parser.parse_args()
    start = time.perf_counter()
    build_model(load_scene(options.scene))
    print(f"OpenGL by {choose_gl()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    print(f"building the lab: {time.perf_counter() - start:.2f} s")
    for samples in (0, 4):
        bench_pictures(options.scene, options.count, samples)
    print()
    bench_flight(options.scene, (320, 180), look=False, mask=False)
    bench_flight(options.scene, (320, 180), look=True, mask=False)
    bench_flight(options.scene, (320, 180), look=True, mask=True)
    bench_flight(options.scene, (640, 360), look=True, mask=False)
    bench_flight(options.scene, (640, 360), look=True, mask=True)
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"\npeak memory {peak_mb:.0f} MB")


if __name__ == "__main__":
    main()
