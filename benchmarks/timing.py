"""Time the tree, perception and records.

    python -m benchmarks.timing ticks       # ticks a second of a tree, and of py_trees
    python -m benchmarks.timing pipeline    # milliseconds of each stage of perception
    python -m benchmarks.timing record      # a tick with and without a record, and its size

Times are those of the processor, which other programs hardly stretch, but for `record`: wall time.
Networks have one thread.
"""

from __future__ import annotations

import argparse
import math
import os
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from py_trees import behaviour, behaviours, composites
from py_trees.common import Access
from py_trees.common import Status as Theirs

from perception.depth.runtime import load_depth_estimator
from perception.segmentation.runtime import shipped_unet
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views, sample_flight_poses
from uav_bt import app
from uav_bt.app.perceive.pipeline import STAGES, Pipeline
from uav_bt.board import ELAPSED
from uav_bt.board.blackboard import Blackboard
from uav_bt.board.context import MissionContext, Proposals
from uav_bt.clock import ManualClock
from uav_bt.learning.views import VALIDATION_SCENES
from uav_bt.mission.tick import TickRecord
from uav_bt.plugins import make_policy
from uav_bt.record.info import record_info
from uav_bt.tree import Leaf, MissionTree, Port, Status
from uav_bt.tree.nodes import AlwaysFailure, AlwaysSuccess, Fallback, Sequence
from uav_bt.types import Frame

WARM_UP: Final = 10  # turns that are not counted
TICKS: Final = 100  # in a turn
GIMBAL_RAD: Final = math.radians(-28.0)  # where a mission holds it
RECORDED: Final = """<root BTCPP_format="4"><BehaviorTree ID="Main"><ReactiveSequence>
  <Segment model="unet"/><FindMark/><TrackMotion/><MapSite/>
  <Sequence><TakeOff height_m="1.5"/><Turn degrees="60"/><HoverFor seconds="8"/><Land/>
  </Sequence></ReactiveSequence></BehaviorTree></root>"""


def in_turns(work: Mapping[str, Callable[[], object]], count: int) -> dict[str, list[float]]:
    """Let contestants tick in turns; return the processor time of each turn in milliseconds."""
    taken: dict[str, list[float]] = {name: [] for name in work}
    for turn in range(WARM_UP + count):
        for name, tick in work.items():
            began_s = time.process_time()
            for _ in range(TICKS):
                tick()
            if turn >= WARM_UP:
                taken[name].append(1e3 * (time.process_time() - began_s))
    return taken


def show(taken: Mapping[str, list[float]]) -> None:
    """Print median and 99th percentile."""
    for name, ms in taken.items():
        p50, p99 = np.percentile(ms, [50, 99])
        print(f"{name:20s} median {p50:8.2f} ms, 99 % {p99:8.2f} ms")


# --- ticks ----------------------------------------------------------------------------------------


class Reader(Leaf):
    """Reads a number through its port and answers."""

    VALUE = Port("value", float, doc="what is read")
    ports = (VALUE,)

    def __init__(self, value: str, *, good: bool) -> None:
        super().__init__(value=value)
        self._limit = 0.0 if good else math.inf

    def update(self) -> Status:
        """Read and compare."""
        return Status.SUCCESS if self.port(self.VALUE) >= self._limit else Status.FAILURE


class TheirReader(behaviour.Behaviour):
    """Reads a number through a blackboard client and answers."""

    def __init__(self, *, good: bool) -> None:
        super().__init__("reader")
        self._limit = 0.0 if good else math.inf
        self._client = self.attach_blackboard_client()
        self._client.register_key("number", Access.WRITE)
        self._client.number = 1.0

    def update(self) -> Theirs:
        """Read and compare."""
        return Theirs.SUCCESS if self._client.number >= self._limit else Theirs.FAILURE


def root_of(leaf: Callable[..., Any], sequence: Callable[..., Any], fallback: Any) -> Any:
    """Return a tree of 50 nodes, sequences and fallbacks in turn; each tick visits all of them."""
    branches = []
    for index in range(7):
        leaves = [leaf(good=index % 2 == 0 or number == 5) for number in range(6)]
        branches.append((fallback if index % 2 else sequence)(f"branch{index}", leaves))
    return sequence("root", branches)


def ticks() -> None:
    """Print ticks a second."""
    work: dict[str, Callable[[], object]] = {}
    leaves: dict[str, Callable[..., object]] = {
        "bare": lambda good: AlwaysSuccess() if good else AlwaysFailure(),
        "{key}": partial(Reader, "{number}"),
        "{@key}": partial(Reader, "{@elapsed_s}"),
    }
    for name, leaf in leaves.items():
        tree, clock = MissionTree(root_of(leaf, Sequence, Fallback)), ManualClock()
        board = Blackboard(clock, (ELAPSED,))
        board.write(ELAPSED, 1.0)
        tree.variables["number"] = 1.0
        tree.setup(
            MissionContext(board=board, clock=clock, proposals=Proposals(), policy=make_policy)
        )
        work[name] = tree.tick
    theirs = (
        lambda name, children: composites.Sequence(name, memory=True, children=children),
        lambda name, children: composites.Selector(name, memory=True, children=children),
    )
    work["py_trees, bare"] = root_of(
        lambda good: (behaviours.Success if good else behaviours.Failure)("answer"), *theirs
    ).tick_once
    work["py_trees, reads"] = root_of(TheirReader, *theirs).tick_once
    for name, ms in in_turns(work, 50).items():
        print(f"{name:16s}{1e3 * TICKS / np.median(ms):8,.0f} ticks a second")


# --- perception -----------------------------------------------------------------------------------


def pipeline() -> None:
    """Print the times of the second level's perception on frames of the twin, by stage."""
    perception = Pipeline(
        shipped_unet(threads=1),
        load_depth_estimator("depth", threads=1),
        anafi_camera(640, 360),
        generator=np.random.default_rng(0),
        timer=time.process_time,
    )
    taken: dict[str, list[float]] = {stage: [] for stage in (*STAGES, "whole")}
    for name in VALIDATION_SCENES:
        scene, rng = load_scene(name), np.random.default_rng(7)
        poses = [
            replace(pose, pitch_rad=GIMBAL_RAD) for pose in sample_flight_poses(scene, rng, 60)
        ]
        for number, view in enumerate(render_views(scene, poses, profile=Profile(), seed=7)):
            frame = Frame(
                image=view.image,
                index=number,
                captured_s=0.1 * number,
                gimbal_pitch_rad=GIMBAL_RAD,
                height_above_ground_m=view.pose.z_m,
            )
            spent_s = perception.perceive(frame).stage_s
            for stage, ms in taken.items():
                s = sum(spent_s.values()) if stage == "whole" else spent_s.get(stage, 0.0)
                if number >= WARM_UP:
                    ms.append(1e3 * s)
    show(taken)


# --- records --------------------------------------------------------------------------------------


class Ticks:
    """Keeps how long each tick computed, in milliseconds."""

    def __init__(self) -> None:
        self.ms: list[float] = []

    def on_tick(self, record: TickRecord) -> None:
        """Keep a tick."""
        self.ms.append(1e3 * record.compute_s)


def record() -> None:
    """Fly with and without a record in turns, at the pace of a real drone."""
    kept = {name: Ticks() for name in ("none", "lossless", "high")}
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(3):
            for name, each in kept.items():
                options = app.FlightOptions(scene="train-a", seed=seed, realtime=True)
                file = Path(folder) / f"{name}-{seed}.mcap"
                if name != "none":
                    options = replace(options, record=file, record_quality=name)
                app.fly(RECORDED, options, listeners=[lambda _, each=each: [each]])
                if name != "none":
                    info = record_info(file)
                    left_out = sum(channel.dropped for channel in info.channels)
                    print(
                        f"{name}: {60e-6 * info.bytes / info.duration_s:.0f} MB a minute, "
                        f"{left_out} messages left out, {info.lost_ticks} lost ticks"
                    )
    show({name: each.ms for name, each in kept.items()})


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    timed = {each.__name__: each for each in (ticks, pipeline, record)}
    parser.add_argument("what", choices=timed)
    given = parser.parse_args()
    cv2.setNumThreads(1)
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    timed[given.what]()


if __name__ == "__main__":
    main()
