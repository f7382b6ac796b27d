"""Missions over Parrot's SDK against the loopback ANAFI: outcomes, latency, frame rate, CPU share.

Run it with a Python that has Olympe; the drone is served by another process, by default with the
same Python:

    python benchmarks/olympe_flights.py --flights 10 --scene train-a

Latency is from a frame's arrival at this program to the moment its command was handed to the SDK:
conversion, perception and tree included, rendering and encoding not. A frame that came while the
one before was still being processed is never used and does not count. On a virtual machine the time
that its host gave to others is printed, too: latencies grow with it.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from sim_bridge.olympe.drone import OlympeDrone
from sim_bridge.olympe.video import DecodedFrame, NewestFrame
from uav_bt import app
from uav_bt.app.site import Site
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import Drone
from uav_bt.types import Command


class Latencies:
    """From each frame's arrival to its command; wraps the drone's two ends."""

    def __init__(self) -> None:
        self.arrived: dict[int, float] = {}
        self.commanded: dict[int, float] = {}
        self.looked: int | None = None

    @contextmanager
    def measured(self) -> Iterator[None]:
        """Measure all drones while this lasts."""
        take, send = NewestFrame.take, OlympeDrone.send

        def timed_take(frames: NewestFrame, decoded: DecodedFrame) -> None:
            self.arrived[len(self.arrived)] = time.perf_counter()
            take(frames, decoded)

        def timed_send(drone: OlympeDrone, command: Command) -> Command:
            sent = send(drone, command)
            if self.looked is not None:
                self.commanded.setdefault(self.looked, time.perf_counter())
            return sent

        NewestFrame.take, OlympeDrone.send = timed_take, timed_send  # type: ignore[method-assign]
        try:
            yield
        finally:
            NewestFrame.take, OlympeDrone.send = take, send  # type: ignore[method-assign]

    def watch(self, flight: app.Flight[Drone]) -> Sequence[Latencies]:
        """Follow a flight."""
        drone = flight.drone
        observe = drone.observe

        def noted_observe() -> object:
            seen = observe()
            self.looked = None if seen.frame is None else seen.frame.index
            return seen

        drone.observe = noted_observe  # type: ignore[method-assign,assignment]
        return (self,)

    def on_tick(self, record: TickRecord) -> None:
        """Nothing to do: the two ends are timed."""

    def summary(self) -> str:
        """Return the percentiles."""
        ms = [1e3 * (self.commanded[i] - self.arrived[i]) for i in self.commanded]
        p50, p95, p99 = np.percentile(ms, [50, 95, 99])
        span_s = max(self.arrived.values()) - min(self.arrived.values())
        return (
            f"frame to command p50 {p50:.1f} ms, p95 {p95:.1f} ms, p99 {p99:.1f} ms; "
            f"{len(self.arrived) / span_s:.1f} frames/s came, {len(ms) / span_s:.1f}/s were used"
        )


def machine_s() -> tuple[float, float]:
    """Return the time of all cores, and how much of it the host gave to others, seconds (Linux)."""
    hundredths = [int(number) for number in Path("/proc/stat").read_text().split()[1:9]]
    return sum(hundredths) / 100.0, hundredths[7] / 100.0


@contextmanager
def _served(python: str, address: str, scene: str, seed: int, rate: float) -> Iterator[None]:
    """Serve a drone while this lasts."""
    arguments = [
        *(python, "-m", "uav_bt.cli", "serve-anafi", "--address", address, "--scene", scene),
        *("--seed", str(seed), "--rate", f"{rate:g}"),
    ]
    server = subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True)  # noqa: S603
    try:
        assert server.stdout is not None  # noqa: S101  (asked for above)
        server.stdout.readline()  # printed once it listens
        yield
    finally:
        server.terminate()
        server.wait()


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tree", default="explore_and_land_depth")
    parser.add_argument("--flights", type=int, default=10)
    parser.add_argument("--scene", default="train-a")
    parser.add_argument("--rate", type=float, default=15.0, help="of the video, frames a second")
    parser.add_argument("--server-python", default=sys.executable)
    parser.add_argument("--reports", type=Path, help="folder for the flights' reports")
    args = parser.parse_args()
    good = 0
    for number in range(args.flights):
        address = f"127.0.1.{number + 1}"
        latencies = Latencies()
        options = app.FlightOptions(
            drone=f"anafi:{address}", site=Site(take_off_surface_m=0.4, video_latency_s=0.03)
        )
        with _served(args.server_python, address, args.scene, number, args.rate):
            wall_s, cpu_s = time.perf_counter(), time.process_time()
            cores_s, stolen_s = machine_s()
            with latencies.measured():
                report = app.fly(
                    args.tree,
                    options,
                    report=args.reports / f"{number}.json" if args.reports else None,
                    listeners=[latencies.watch],
                )
            share = (time.process_time() - cpu_s) / (time.perf_counter() - wall_s)
            all_s, gone_s = machine_s()
            stolen = (gone_s - stolen_s) / (all_s - cores_s)
        good += report.outcome == "success"
        print(
            f"{number}: {report.outcome}, {report.reason}; {report.duration_s or 0.0:.0f} s; "
            f"{latencies.summary()}; {100 * share:.0f} % of a core; "
            f"{100 * stolen:.0f} % of the machine's time was stolen",
            flush=True,
        )
    print(f"{good} of {args.flights} succeeded")


if __name__ == "__main__":
    main()
