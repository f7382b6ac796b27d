"""The way home by the map, and under the rule alone: from exploring to motors off.

    python benchmarks/way_home.py --explore rule
    python benchmarks/way_home.py --explore hall --home map
    python benchmarks/way_home.py --home map --profile harsh

Exact masks at 320x180 and no depth, so that only the flying differs. `--explore rule` and `survey`
explore for 30 s, under the segmentation rule and under the coverage policy; `hall` is the hall of
10 x 10 m, taken off from far from the pad, where the search begins at once.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import yaml
from mission_text import explore_and_come_home

from uav_bt import app
from uav_bt.errors import UavBtError
from uav_bt.mission.flight_report import FlightReport

_EXPLORE_S = 30
_FLIGHTS = (
    *(("train-a", 1), ("val-a", 1), ("train-c", 2), ("val-b", 2)),
    *(("train-d", 3), ("train-b", 3), ("val-a", 4), ("val-b", 4)),
)
_HALL = Path(__file__).parent / "scenes" / "hall-10m.yaml"
_HALL_STARTS = ((2.6, 2.2, 45), (0.0, 2.4, 180), (3.0, -3.0, 90))
_EXPLORES = {
    "hall": "<AlwaysSuccess/>",
    "rule": """<Repeat num_cycles="-1"><Fallback>
        <Explore policy="segmentation"/><Avoid policy="segmentation"/></Fallback></Repeat>""",
    "survey": """<RetryUntilSuccessful num_attempts="-1"><Fallback><Explore policy="coverage"/>
        <ForceFailure><Avoid policy="coverage"/></ForceFailure></Fallback>
        </RetryUntilSuccessful>""",
}


@dataclass(frozen=True)
class Task:
    """One flight."""

    home: str  # map or rule: what searches
    explore: str
    scene: str
    seed: int
    profile: str
    start: tuple[float, float, float] | None = None  # x, y, yaw in degrees


def _tree(task: Task) -> str:
    approach = "memory" if task.home == "map" else "policy"
    return explore_and_come_home(
        explore=_EXPLORES[task.explore],
        explore_s=_EXPLORE_S,
        home=f'<ReturnToBase policy="segmentation" approach="{approach}"/>',
        gimbal_deg=-42 if task.explore == "survey" else -30,
    )


def _fly(task: Task) -> tuple[Task, FlightReport]:
    with tempfile.TemporaryDirectory() as folder:
        scene = task.scene
        if task.start is not None:
            *place, yaw_deg = task.start
            lab = yaml.safe_load(_HALL.read_text(encoding="utf-8"))
            lab["take_off"] = {"from": place, "yaw_deg": yaw_deg}
            scene = str(Path(folder) / "hall.yaml")
            Path(scene).write_text(yaml.safe_dump(lab), encoding="utf-8")
        options = app.FlightOptions(
            scene=scene,
            seed=task.seed,
            profile=task.profile,
            exact_masks=True,
            image_size_px=(320, 180),
        )
        return task, app.fly(_tree(task), options)


def home_s(report: FlightReport) -> float | None:
    """Return the time from the end of exploring until motors off; None where it did not land."""
    if report.time_to_find_helipad_s is None or report.time_to_land_s is None:
        return None
    return report.time_to_find_helipad_s + report.time_to_land_s


def _line(task: Task, report: FlightReport) -> str:
    seconds, error_m = home_s(report), report.landing_error_m
    landed = (
        "" if seconds is None or error_m is None else f"{seconds:5.1f} s {100 * error_m:3.0f} cm"
    )
    found_s = report.time_to_find_helipad_s
    found = "pad not found" if found_s is None else f"found after {found_s:.0f} s"
    searched_m = report.search_distance_m
    flown = f"{report.total_distance_m if searched_m is None else searched_m:.1f} m"
    return (
        f"{task.home:5s}{task.explore:7s}{task.scene:8s} seed {task.seed}  {report.outcome:10s}"
        f"{landed:14s} {found}, {flown}  clearance {report.min_clearance_m:.2f} m"
    )


def _summary(reports: Sequence[FlightReport], home: str) -> str:
    times = [seconds for seconds in map(home_s, reports) if seconds is not None]
    errors = [report.landing_error_m for report in reports if report.landing_error_m is not None]
    return (
        f"{home:5s}{sum(report.outcome == 'success' for report in reports)} of "
        f"{len(reports)} landed, home in {np.mean(times or [np.nan]):.1f} s (longest "
        f"{max(times, default=np.nan):.1f}), error {100 * np.mean(errors or [np.nan]):.0f} cm"
    )


def main() -> int:
    """Fly all, print each and the sums."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--explore", choices=sorted(_EXPLORES), default="rule")
    parser.add_argument("--home", choices=("map", "rule", "both"), default="both")
    parser.add_argument("--profile", choices=("ideal", "lab", "harsh"), default="lab")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    places = [(scene, seed, None) for scene, seed in _FLIGHTS]
    if arguments.explore == "hall":
        places = [("hall", seed, start) for seed in (1, 2) for start in _HALL_STARTS]
    homes = ("map", "rule") if arguments.home == "both" else (arguments.home,)
    tasks = [
        Task(home, arguments.explore, scene, seed, arguments.profile, start)
        for scene, seed, start in places
        for home in homes
    ]
    flights = []
    with ProcessPoolExecutor(arguments.workers, mp_context=get_context("spawn")) as pool:
        for task, report in pool.map(_fly, tasks):
            flights.append((task, report))
            print(_line(task, report), flush=True)
    for home in homes:
        print(_summary([report for task, report in flights if task.home == home], home))
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except UavBtError as error:
        sys.exit(f"{error}")
