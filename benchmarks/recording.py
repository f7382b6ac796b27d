"""Cost of recording, and records of killed flights.

    python benchmarks/recording.py overhead   # tick with and without a record, in turns; sizes
    python benchmarks/recording.py kills      # 20 flights killed at random; what can be read

Flights keep pace with the wall clock, as real ones do: then nothing waits for the disk.
"""

from __future__ import annotations

import argparse
import json
import random
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from uav_bt import app
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.protocols import Drone
from uav_bt.record.info import record_info
from uav_bt.record.reader import RecordReader
from uav_bt.record.recorder import FlightRecorder

TREE = """<root BTCPP_format="4"><BehaviorTree ID="Main"><ReactiveSequence>
  <Segment model="unet"/><FindMark/><TrackMotion/><MapSite/>
  <Sequence><TakeOff height_m="1.5"/><Turn degrees="60"/><HoverFor seconds="{hover_s}"/><Land/>
  </Sequence></ReactiveSequence></BehaviorTree></root>"""
HOVER = """<root BTCPP_format="4"><BehaviorTree ID="Main">
  <Sequence><TakeOff height_m="1.5"/><HoverFor seconds="60"/><Land/></Sequence>
</BehaviorTree></root>"""
KILLED = """
import os, signal, sys
from pathlib import Path
from uav_bt import app

class Kill:
    def on_tick(self, record):
        if record.index == int(sys.argv[3]):
            os.kill(os.getpid(), signal.SIGKILL)

app.fly(
    sys.argv[1],
    app.FlightOptions(scene="train-a", record=Path(sys.argv[2]), realtime=True),
    listeners=[lambda flight: [Kill()]],
)
"""


class Ticks:
    """Keeps how long every tick computed."""

    def __init__(self) -> None:
        self.compute_s: list[float] = []

    def listeners(self, _: app.Flight[Drone]) -> Sequence[TickListener]:
        """Begin with a flight."""
        return [self]

    def on_tick(self, record: TickRecord) -> None:
        """Keep a tick."""
        self.compute_s.append(record.compute_s)


def percentiles(values_s: Sequence[float]) -> str:
    """Return median and 99th percentile in milliseconds."""
    p50, p99 = 1e3 * np.percentile(values_s, [50, 99])
    return f"p50 {p50:7.3f} ms  p99 {p99:7.3f} ms"


def _overhead(rounds: int, hover_s: float, folder: Path) -> None:
    """Fly the same flight with and without a record in turns, and compare the ticks."""
    tree = folder / "hover.xml"
    tree.write_text(TREE.format(hover_s=hover_s), encoding="utf-8")
    handed: list[float] = []
    on_tick = FlightRecorder.on_tick

    def timed(recorder: FlightRecorder, record: TickRecord) -> None:
        began_s = time.perf_counter()
        on_tick(recorder, record)
        handed.append(time.perf_counter() - began_s)

    FlightRecorder.on_tick = timed  # type: ignore[method-assign]
    ticks: dict[str, Ticks] = {name: Ticks() for name in ("none", "lossless", "high")}
    hands: dict[str, list[float]] = {name: [] for name in ticks}
    sizes: dict[str, list[str]] = {name: [] for name in ticks}
    for seed in range(rounds):
        for name, kept in ticks.items():
            record = None if name == "none" else folder / f"{name}-{seed}.mcap"
            options = app.FlightOptions(
                scene="train-a",
                seed=seed,
                realtime=True,
                record=record,
                record_quality="high" if name == "high" else "lossless",
            )
            handed.clear()
            app.fly(tree, options, listeners=[kept.listeners])
            hands[name] += handed
            if record is not None:
                sizes[name].append(_described(record))
    for name, kept in ticks.items():
        print(f"{name:9} tick  {percentiles(kept.compute_s)}  ({len(kept.compute_s)} ticks)")
        if hands[name]:
            print(f"{name:9} hand  {percentiles(hands[name])}")
        for line in sizes[name]:
            print(f"{name:9} {line}")


def _described(record: Path) -> str:
    opened_s = []
    for _ in range(5):
        began_s = time.perf_counter()
        RecordReader(record)
        opened_s.append(time.perf_counter() - began_s)
    info = record_info(record)
    dropped = {channel.topic: channel.dropped for channel in info.channels if channel.dropped}
    per_minute = info.bytes / 1e6 / info.duration_s * 60.0
    return (
        f"{per_minute:.0f} MB a minute, opened in {1e3 * statistics.median(opened_s):.1f} ms, "
        f"left out {json.dumps(dropped)}, lost ticks {info.lost_ticks}"
    )


def _kills(count: int, folder: Path) -> None:
    """Kill flights at random and check their records."""
    tree = folder / "hover.xml"
    tree.write_text(HOVER, encoding="utf-8")
    draw = random.Random(7)  # noqa: S311 - no secret
    lost_s = []
    for index in range(count):
        record, tick = folder / f"killed-{index}.mcap", draw.randrange(15, 80)
        subprocess.run(  # noqa: S603 - our own interpreter and code
            [sys.executable, "-c", KILLED, str(tree), str(record), str(tick)],
            check=False,
            capture_output=True,
        )
        moments = list(RecordReader(record).moments())
        whole = [moment.tick.index for moment in moments] == list(range(len(moments)))
        lost_s.append(0.1 * (tick + 1 - len(moments)))
        print(f"killed in tick {tick}: {len(moments)} ticks read, in order: {whole}")
        record.unlink()
    print(f"{count} killed, all read; lost {statistics.mean(lost_s):.2f} s, {max(lost_s):.2f} most")


def main() -> None:
    """Run the measurements."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("what", choices=["overhead", "kills"])
    parser.add_argument("--rounds", type=int, default=3, help="pairs of flights")
    parser.add_argument("--hover", type=float, default=8.0, help="seconds each flight hovers")
    parser.add_argument("--count", type=int, default=20, help="flights that are killed")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if arguments.what == "overhead":
            _overhead(arguments.rounds, arguments.hover, Path(folder))
        else:
            _kills(arguments.count, Path(folder))


if __name__ == "__main__":
    main()
