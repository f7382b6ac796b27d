"""How fast campaigns fly: one worker, two, and a Dask cluster of two; and whether they agree.

    python benchmarks/campaign.py --flights 12 --out runs/campaign_benchmark

Each way flies the same seeds afresh. It prints wall time, flights an hour, the peak of this
process's and its children's resident memory added up, and whether all flights are the same. Run it
on a machine with nothing else to do.
"""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Self

import psutil
from distributed import LocalCluster

from uav_bt import campaign as campaigns
from uav_bt.campaign.cluster import DaskBackend
from uav_bt.campaign.flight_lines import comparable
from uav_bt.campaign.runner import Backend, LocalBackend


class MemoryPeak:
    """Measures the memory of a process and its children, twice a second."""

    def __init__(self) -> None:
        self.max_bytes = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def _watch(self) -> None:
        me = psutil.Process()
        while not self._stop.wait(0.5):
            total = 0
            for process in (me, *me.children(recursive=True)):
                try:
                    total += process.memory_info().rss
                except psutil.NoSuchProcess:
                    continue  # it ended while we were looking
            self.max_bytes = max(self.max_bytes, total)


def main() -> int:
    """Run the command line; 1 when two ways disagree."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tree", default="explore_and_land_segmentation")
    parser.add_argument("--scenes", default="val-*")
    parser.add_argument("--flights", type=int, default=12, help="seeds per scene")
    parser.add_argument("--profile", default="lab")
    parser.add_argument("--exact-masks", action="store_true")
    parser.add_argument("--width", type=int, default=640, help="of the 16:9 video, pixels")
    parser.add_argument("--out", type=Path, default=Path("runs/campaign_benchmark"))
    args = parser.parse_args()
    plan = campaigns.make_plan(
        [args.tree],
        scenes=[args.scenes],
        flights=args.flights,
        profile=args.profile,
        exact_masks=args.exact_masks,
        image_size_px=(args.width, args.width * 9 // 16),
    )
    print(
        f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, "
        f"{time.strftime('%Y-%m-%d')}: {len(plan)} flights of {args.tree}"
    )
    print(f"{'':16s}{'wall, s':>9s}{'flights/h':>11s}{'peak, MiB':>11s}{'speed-up':>10s}  same")
    with ExitStack() as stack:

        def cluster() -> Backend:
            two = LocalCluster(
                n_workers=2,
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
            )
            return DaskBackend(stack.enter_context(two).scheduler_address)

        ways: dict[str, Callable[[], Backend]] = {
            "1 worker": lambda: LocalBackend(1),
            "2 workers": lambda: LocalBackend(2),
            "Dask, 2 workers": cluster,
        }
        first, base_s, agree = None, 0.0, True
        for name, make in ways.items():
            backend = make()
            folder = args.out / name.replace(", ", "-").replace(" ", "-")
            shutil.rmtree(folder, ignore_errors=True)
            began_s = time.perf_counter()
            with MemoryPeak() as peak:
                result = campaigns.run(plan, folder, backend=backend)
            wall_s = time.perf_counter() - began_s
            flights = [comparable(flight) for flight in result.flights]
            first, base_s = first or flights, base_s or wall_s
            agree = agree and flights == first
            print(
                f"{name:16s}{wall_s:9.1f}{3600 * len(plan) / wall_s:11.0f}"
                f"{peak.max_bytes / 2**20:11.0f}{base_s / wall_s:10.2f}"
                f"  {'yes' if flights == first else 'NO'}"
            )
    return 0 if agree else 1


if __name__ == "__main__":
    raise SystemExit(main())
