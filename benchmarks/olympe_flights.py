"""Missions over Parrot's SDK against the loopback ANAFI: outcomes, latency, frame rate, CPU share.

Run it with a Python that has Olympe; the drone is served by another process, by default with the
same Python:

    python -m benchmarks.olympe_flights --flights 10 --scene train-a

Latency is from a frame's arrival at this program to the moment its command was handed to the SDK's
thread: conversion, perception and tree included, rendering and encoding not; a table says where it
goes. A frame that came while the one before was still being processed is never used and does not
count. Load, and on a virtual machine the time that its host gave to others, are printed, too:
latencies grow with them.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from functools import partial
from pathlib import Path

from benchmarks.loopback_drone import served
from benchmarks.olympe_stages import TimedDrone, TimedQueue, table, timed_drone
from sim_bridge.olympe import AnafiConfig
from sim_bridge.olympe.drone import OlympeDrone
from uav_bt import app
from uav_bt.app.site import Site
from uav_bt.errors import UavBtError


def machine_s() -> tuple[float, float]:
    """Return the time of all cores, and how much of it the host gave to others, seconds (Linux)."""
    hundredths = [int(number) for number in Path("/proc/stat").read_text().split()[1:9]]
    return sum(hundredths) / 100.0, hundredths[7] / 100.0


def fly(args: argparse.Namespace, number: int) -> tuple[TimedDrone, TimedQueue, bool]:
    """Fly one mission, print a line about it, and return its times and whether it succeeded.

    Raises:
        UavBtError: it could not be flown, or ended with an error.
    """
    address = f"127.0.1.{number + 1}"
    latency_s = 0.03 if args.profile == "ideal" else AnafiConfig.video_latency_s
    config = AnafiConfig(address=address, take_off_surface_m=0.4, video_latency_s=latency_s)
    drone, queue = timed_drone(partial(OlympeDrone, config))
    options = app.FlightOptions(drone=drone, site=Site(take_off_surface_m=0.4))
    with served(
        address,
        "--profile",
        args.profile,
        scene=args.scene,
        seed=number,
        rate_hz=args.rate,
        python=args.server_python,
    ) as printed:
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        cores_s, stolen_s = machine_s()
        report = app.fly(
            args.tree,
            options,
            report=args.reports / f"{number}.json" if args.reports else None,
            listeners=[drone.watch],
        )
        share = (time.process_time() - cpu_s) / (time.perf_counter() - wall_s)
        all_s, gone_s = machine_s()
        stolen = (gone_s - stolen_s) / (all_s - cores_s)
    print(f"drone: {'; '.join(printed)}", flush=True)
    p50, p95, p99 = drone.frame_to_command_ms()
    came_hz, used_hz = drone.used_hz()
    print(
        f"{number}: {report.outcome}, {report.reason}; {report.duration_s or 0.0:.0f} s; "
        f"frame to command p50 {p50:.1f} ms, p95 {p95:.1f} ms, p99 {p99:.1f} ms; "
        f"{came_hz:.1f} frames/s came, {used_hz:.1f}/s were used; {100 * share:.0f} % of a "
        f"core; load {os.getloadavg()[0]:.1f}, {100 * stolen:.0f} % of the machine's time was "
        "stolen",
        flush=True,
    )
    return drone, queue, report.outcome == "success"


def main() -> int:
    """Fly and print; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tree", default="explore_and_land_depth")
    parser.add_argument("--flights", type=int, default=10)
    parser.add_argument("--scene", default="train-a")
    parser.add_argument("--rate", type=float, default=15.0, help="of the video, frames a second")
    parser.add_argument("--profile", default="lab", help="'ideal': a camera without a delay")
    parser.add_argument("--server-python", default=sys.executable)
    parser.add_argument("--reports", type=Path, help="folder for the flights' reports")
    args = parser.parse_args()
    flown = []
    for number in range(args.flights):
        try:
            flown.append(fly(args, number))
        except UavBtError as error:
            print(f"{number}: {type(error).__name__}: {error}", flush=True)
    if flown:
        drones, queues, _ = zip(*flown, strict=True)
        print("\n".join(table(drones, queues)))
    good = sum(success for *_, success in flown)
    print(f"{good} of {args.flights} succeeded")
    return 0 if good == args.flights else 1


if __name__ == "__main__":
    sys.exit(main())
