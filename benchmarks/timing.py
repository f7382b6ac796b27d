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
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from py_trees import behaviour, behaviours, composites
from py_trees.common import Access
from py_trees.common import Status as Theirs

from benchmarks.lab_views import frame_of
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
from uav_bt.plugins import make_policy
from uav_bt.record.info import record_info
from uav_bt.tree import Leaf, MissionTree, Port, Status
from uav_bt.tree.nodes import AlwaysFailure, AlwaysSuccess, Fallback, Sequence

TURNS: Final = 50
WARM_UP: Final = 10  # turns or frames that are not counted
TICKS: Final = 100  # in a turn
GIMBAL_RAD: Final = math.radians(-28.0)  # where a mission holds it
RECORDED: Final = """<root BTCPP_format="4"><BehaviorTree ID="Main"><ReactiveSequence>
  <Segment model="unet"/><FindMark/><TrackMotion/><MapSite/>
  <Sequence><TakeOff height_m="1.5"/><Turn degrees="60"/><HoverFor seconds="8"/><Land/>
  </Sequence></ReactiveSequence></BehaviorTree></root>"""


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
    """Print ticks a second of trees that tick in turns."""

    def theirs(kind: Any) -> Callable[..., Any]:
        return lambda name, children: kind(name, memory=True, children=children)

    both = theirs(composites.Sequence), theirs(composites.Selector)
    work: dict[str, Callable[[], object]] = {
        "py_trees, bare": root_of(
            lambda good: (behaviours.Success if good else behaviours.Failure)("answer"), *both
        ).tick_once,
        "py_trees, reads": root_of(TheirReader, *both).tick_once,
    }
    leaves: dict[str, Callable[..., object]] = {
        "bare": lambda good: AlwaysSuccess() if good else AlwaysFailure(),
        "{key}": partial(Reader, "{number}"),
        "{@key}": partial(Reader, "{@elapsed_s}"),
    }
    for name, leaf in leaves.items():
        tree, clock = MissionTree(root_of(leaf, Sequence, Fallback)), ManualClock()
        board, given = Blackboard(clock, (ELAPSED,)), Proposals()
        board.write(ELAPSED, 1.0)
        tree.variables["number"] = 1.0
        tree.setup(MissionContext(board=board, clock=clock, proposals=given, policy=make_policy))
        work[name] = tree.tick
    taken: dict[str, list[float]] = {name: [] for name in work}
    for _ in range(WARM_UP + TURNS):
        for name, tick in work.items():
            began_s = time.process_time()
            for _ in range(TICKS):
                tick()
            taken[name].append(time.process_time() - began_s)
    for name, spent_s in taken.items():
        print(f"{name:16s}{TICKS / np.median(spent_s[WARM_UP:]):8,.0f} ticks a second")


def pipeline() -> None:
    """Print the times of the second level's perception on frames of the twin, by stage."""
    perception = Pipeline(
        shipped_unet(threads=1),
        load_depth_estimator("depth", threads=1),
        anafi_camera(640, 360),
        timer=time.process_time,
    )
    taken: dict[str, list[float]] = {stage: [] for stage in (*STAGES, "whole")}
    for name in VALIDATION_SCENES:
        scene, rng = load_scene(name), np.random.default_rng(7)
        flown = sample_flight_poses(scene, rng, 60)
        poses = [replace(pose, pitch_rad=GIMBAL_RAD) for pose in flown]
        for number, view in enumerate(render_views(scene, poses, profile=Profile(), seed=7)):
            spent_s = perception.perceive(frame_of(view, number)).stage_s
            for stage, ms in taken.items():
                s = sum(spent_s.values()) if stage == "whole" else spent_s.get(stage, 0.0)
                if number >= WARM_UP:
                    ms.append(1e3 * s)
    for stage, ms in taken.items():
        print(
            "{:20s} median {:8.2f} ms, 99 % {:8.2f} ms".format(stage, *np.percentile(ms, [50, 99]))
        )


def record() -> None:
    """Fly with and without a record in turns, at the pace of a real drone."""
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(3):
            for name in ("none", "lossless", "high"):
                options = app.FlightOptions(scene="train-a", seed=seed, realtime=True)
                file = Path(folder) / f"{name}-{seed}.mcap"
                if name != "none":
                    options = replace(options, record=file, record_quality=name)
                took = app.fly(RECORDED, options).tick_ms
                line = f"{name}: a tick took {took}"
                if name != "none":
                    info = record_info(file)
                    left_out = sum(channel["dropped"] for channel in info["channels"])
                    line += f", {60e-6 * info['bytes'] / info['duration_s']:.0f} MB a minute, "
                    line += f"{left_out} messages left out, {info['lost_ticks']} lost ticks"
                print(line, flush=True)


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
