"""Two places of which figures are published, flown by the survey with networks.

    python benchmarks/published_places.py room --flights 10 --out runs/room
    python benchmarks/published_places.py movers --flights 10 --out runs/movers-8m

`room`    6 x 6 m with six objects, 3 min of survey; the objects stand elsewhere in every flight.
          Which cells of 0.5 m the drone was over, and which objects it found (Lamberti et al.,
          arXiv 2301.12175: 83 % of some 36 m2, and 90 % of six objects).
`movers`  8 x 8 m with four objects and two people or carts at 0.5 to 1 m/s, 5 min of survey: the
          metres flown, and contacts (arXiv 2312.08991: 115 m in 5 min without one).

Each flight is a line of OUT/flights.jsonl, written at once; the same command goes on.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from sim_bridge.twin.drone import TwinDrone
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.variation import varied_scene, with_movers
from uav_bt import app
from uav_bt.errors import UavBtError
from uav_bt.mission.tick import TickRecord
from uav_bt.tree.shipped import resolve_tree

SCENES = Path(__file__).parent / "scenes"
CELL_M = 0.5
MOVER_MPS = (0.5, 1.0)


@dataclass(frozen=True, kw_only=True)
class Place:
    """A place, and for how long it is surveyed."""

    scene: str
    survey_s: int
    layout: bool = False  # objects are placed anew in every flight
    movers: int = 0

    def drawn(self, seed: int) -> Scene:
        """Return the scene of a flight."""
        rng = np.random.default_rng(seed)
        scene = load_scene(SCENES / self.scene)
        if self.layout:
            scene = varied_scene(scene, rng, name=f"{scene.name}-{seed}", layout=True)
        moving = with_movers(scene, self.movers, seed)
        paced = (replace(one, speed_mps=float(rng.uniform(*MOVER_MPS))) for one in moving.movers)
        return replace(moving, movers=tuple(paced))


PLACES = {
    "room": Place(scene="place-6m.yaml", survey_s=180, layout=True),
    "movers": Place(scene="place-8m.yaml", survey_s=300, movers=2),
}


@dataclass
class Track:
    """Where the drone was from the take-off command until the survey was over."""

    survey_s: float
    path_m: list[tuple[float, float]] = field(default_factory=list)
    began_s: float | None = None

    def on_tick(self, record: TickRecord) -> None:
        """Take note of a tick."""
        if self.began_s is None and record.phase:
            self.began_s = record.time_s
        if self.began_s is None or record.time_s - self.began_s > self.survey_s:
            return
        if record.truth is not None:
            self.path_m.append((record.truth.pose.x_m, record.truth.pose.y_m))

    @property
    def length_m(self) -> float:
        """How far it flew."""
        return float(np.hypot(*np.diff(np.array(self.path_m), axis=0).T).sum())

    def cells(self, scene: Scene) -> float:
        """Return the share of the free cells that the drone was over."""
        size_m = np.array(scene.ground.size_m)
        count = np.rint(size_m / CELL_M).astype(int)
        over = np.zeros(tuple(count), dtype=bool)
        cells = np.floor((np.array(self.path_m) + size_m / 2) / CELL_M).astype(int)
        over[tuple(np.clip(cells, 0, count - 1).T)] = True
        free = np.ones_like(over)
        for cell in np.ndindex(over.shape):
            x_m, y_m = (np.array(cell) + 0.5) * CELL_M - size_m / 2
            free[cell] = not any(box.footprint.contains(x_m, y_m) for box in scene.boxes)
        return float((over & free).sum() / free.sum())


def fly(name: str, seed: int) -> dict[str, object]:
    """Fly one flight; return its line."""
    place = PLACES[name]
    scene, track = place.drawn(seed), Track(place.survey_s)
    text = resolve_tree("survey_and_land").read_text(encoding="utf-8")
    text = text.replace('duration_ms="180000"', f'duration_ms="{1000 * place.survey_s}"')
    options = app.FlightOptions(
        drone=TwinDrone(scene, profile=Profile.named("lab"), seed=seed),
        seed=seed,
        judge=app.JudgeConfig(time_limit_s=place.survey_s + 120.0),
    )
    report = app.fly(text, options, listeners=[lambda _: [track]])
    return {
        "seed": seed,
        "outcome": report.outcome,
        "reason": report.reason,
        "surveyed_s": min(report.duration_s or 0.0, place.survey_s),
        "duration_s": report.duration_s,
        "flown_m": round(track.length_m, 2),
        "cells": round(track.cells(scene), 3),
        "passed": report.coverage_passed,
        "objects_found": report.objects_found,
        "objects_total": report.objects_total,
        "clearance_m": report.min_clearance_m,
    }


def summary(flights: list[dict[str, object]]) -> str:
    """Return what all flights came to."""

    def mean(key: str) -> float:
        values = [float(str(each[key])) for each in flights if each[key] is not None]
        return float(np.mean(values)) if values else math.nan

    outcomes = [each["outcome"] for each in flights]
    minutes = sum(float(str(each["surveyed_s"])) for each in flights) / 60.0
    flown_m = sum(float(str(each["flown_m"])) for each in flights)
    found = sum(int(str(each["objects_found"] or 0)) for each in flights)
    total = sum(int(str(each["objects_total"] or 0)) for each in flights)
    return (
        f"{len(flights)} flights: {outcomes.count('success')} landed, "
        f"{outcomes.count('collision')} contacts, {outcomes.count('left_area')} left the ground\n"
        f"{flown_m:.0f} m in {minutes:.1f} min of survey: {5 * flown_m / minutes:.0f} m in 5 min\n"
        f"cells of {CELL_M} m: {100 * mean('cells'):.0f} %, "
        f"ground passed: {100 * mean('passed'):.0f} %, objects: {found} of {total}, "
        f"clearance: {mean('clearance_m'):.2f} m"
    )


def main() -> int:
    """Fly what is missing, then print the sums."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("place", choices=sorted(PLACES))
    parser.add_argument("--flights", type=int, default=10)
    parser.add_argument("--seed-from", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    file = given.out / "flights.jsonl"
    kept = file.read_text(encoding="utf-8").splitlines() if file.is_file() else []
    flights = [json.loads(line) for line in kept]
    seeds = range(given.seed_from, given.seed_from + given.flights)
    missing = [seed for seed in seeds if all(each["seed"] != seed for each in flights)]
    with ProcessPoolExecutor(given.workers, mp_context=get_context("spawn")) as pool:
        for line in pool.map(partial(fly, given.place), missing):
            flights.append(line)
            print(json.dumps(line), flush=True)
            with file.open("a", encoding="utf-8") as out:
                out.write(json.dumps(line) + "\n")
    print(summary(flights))
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except UavBtError as error:
        sys.exit(f"{error}")
