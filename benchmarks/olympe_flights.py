"""Fly missions over Parrot's SDK against the loopback ANAFI.

    python -m benchmarks.olympe_flights --flights 10 --scene train-a

Run it with a Python that has Olympe; another process serves the drone. Each flight is printed as a
line, with the times of a tick, of the stages of perception, and from a frame's arrival to its
command: conversion, perception and tree, without encoding. They grow with the machine's load.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from sim_bridge.olympe import AnafiConfig
from sim_bridge.olympe.drone import OlympeDrone
from sim_bridge.olympe.video import FrameClock
from uav_bt import app
from uav_bt.app.site import Site
from uav_bt.errors import UavBtError
from uav_bt.mission.drone_wrapper import DroneWrapper
from uav_bt.types import Command, Observation

PAD_M = 0.4  # height of the scenes' landing mark, on which the drone stands


class ArrivalClock(FrameClock):
    """Notes when frames arrive."""

    def __init__(self) -> None:
        super().__init__()
        self.arrivals_s: list[float] = []  # by the frame's index

    def frame_arrived(self) -> None:
        """Note it; called on the video's thread."""
        self.arrivals_s.append(time.perf_counter())
        super().frame_arrived()


class TimedDrone(DroneWrapper):
    """Notes the time from each new frame to its command; frames that are never used have none."""

    def __init__(self, drone: OlympeDrone, clock: ArrivalClock) -> None:
        super().__init__(drone)
        self._clock = clock
        self._index = self._used = -1  # of the last frame that was seen, and commanded for
        self.latencies_s: list[float] = []

    def observe(self) -> Observation:
        """Look, and note which frame is there."""
        seen = super().observe()
        if seen.frame is not None:
            self._index = seen.frame.index
        return seen

    def send(self, command: Command) -> Command:
        """Command, timed."""
        sent = super().send(command)
        if self._index > self._used:
            self._used = self._index
            self.latencies_s.append(time.perf_counter() - self._clock.arrivals_s[self._used])
        return sent


def fly(args: argparse.Namespace, number: int) -> bool:
    """Fly one mission, print a line about it, and return whether it succeeded."""
    address = f"127.0.1.{number + 1}"
    words = ["--address", address, "--scene", args.scene, "--seed", str(number)]
    words += ["--rate", f"{args.rate:g}", "--profile", args.profile]
    command = [args.server_python, "-m", "uav_bt", "serve-anafi", *words]
    latency_s = 0.03 if args.profile == "ideal" else AnafiConfig.video_latency_s
    config = AnafiConfig(address=address, take_off_surface_m=PAD_M, video_latency_s=latency_s)
    clock = ArrivalClock()
    drone = TimedDrone(OlympeDrone(config, clock=clock), clock)
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:  # noqa: S603
        try:
            if server.stdout is None or not server.stdout.readline():  # printed once it listens
                raise SystemExit(f"no loopback ANAFI can be served at {address}")
            site = Site(take_off_surface_m=PAD_M)
            file = args.reports / f"{number}.json" if args.reports else None
            report = app.fly(args.tree, drone=drone, site=site, report=file)
        except UavBtError as error:
            print(f"{number}: {type(error).__name__}: {error}", flush=True)
            return False
        finally:
            server.terminate()
    latency_ms = 1e3 * np.percentile(drone.latencies_s or [np.nan], [50, 95, 99])
    print(
        f"{number}: {report.outcome}, {report.reason}; {report.duration_s or 0.0:.0f} s; tick "
        f"{report.tick_ms}, {report.perception_ms} ms; frame to command "
        f"p50, p95, p99 {latency_ms.round(1)} ms; load {os.getloadavg()[0]:.1f}",
        flush=True,
    )
    return report.outcome == "success"


def main() -> int:
    """Fly and print; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tree", default="explore_and_land_depth")
    parser.add_argument("--flights", type=int, default=10)
    parser.add_argument("--scene", default="train-a")
    parser.add_argument("--rate", type=float, default=15.0, help="of the video, frames a second")
    parser.add_argument("--profile", default="lab", help="'ideal': a camera without a delay")
    parser.add_argument("--server-python", default=sys.executable)
    parser.add_argument("--reports", type=Path, help="folder for the flights' reports")
    args = parser.parse_args()
    good = sum(fly(args, number) for number in range(args.flights))
    print(f"{good} of {args.flights} succeeded")
    return 0 if good == args.flights else 1


if __name__ == "__main__":
    sys.exit(main())
