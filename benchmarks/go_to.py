"""Measure GoTo: how near to random places it comes, how fast, and how far from obstacles.

    python -m benchmarks.go_to --drone plain --scenes val-a,val-b --flights 4 --out runs/go-to
    python -m benchmarks.go_to --exact-masks --image-size 320x180 --out runs/go-to-exact
    python -m benchmarks.go_to --scenes test-a,test-b --movers 1 --out runs/go-to-movers
    python -m benchmarks.go_to --places 1 --faults "pilot@go to+1~3" --out runs/go-to-pilot

Each flight visits some places that are 0.5 m and more from obstacles, movers' paths and edges. The
distances to them are those of the truth. A flight is a line of DIR/flights.jsonl, and those that
are there are not flown again.
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.mission_text import in_flight
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene
from uav_bt import app
from uav_bt.mission.tick import TickRecord
from uav_bt.types import Pose, Pose2D
from uav_bt.types.place_frames import lab_to_start

FREE_M = 0.5  # least distance of a place from obstacles and edges
FLIGHTS = "flights.jsonl"


@dataclass(kw_only=True)
class Visit:
    """The flight to one place.

    Attributes:
        place: The place in the drawing of the scene.
        begin_s: Time of the mission clock.
        apart_m: Straight distance at the beginning.
        end_s: Time at the end; None while it lasts.
        reached: Whether GoTo succeeded.
        error_m: Distance from the place at the end, by the truth.
        clearance_m: Least clearance of the hull.
        reason: Status line at the end.
    """

    place: tuple[float, float]
    begin_s: float
    apart_m: float
    end_s: float | None = None
    reached: bool = False
    error_m: float = math.nan
    clearance_m: float = math.inf
    reason: str = ""


@dataclass
class VisitLog:
    """Notes the visits of a flight; the nodes `go_N`, `there_N` and `missed_N` delimit them."""

    places: list[tuple[float, float]]
    visits: list[Visit] = field(default_factory=list)

    def on_tick(self, record: TickRecord) -> None:
        """Take note of a tick."""
        if record.truth is None or not record.active:
            return
        pose, node = record.truth.pose, record.active[-1]
        visit = self.visits[-1] if self.visits else None
        place = self.places[int(node[3:])] if node.startswith("go_") else None
        if place is not None and (visit is None or visit.place != place):
            apart_m = math.dist(place, (pose.x_m, pose.y_m))
            visit = Visit(place=place, begin_s=record.time_s, apart_m=apart_m)
            self.visits.append(visit)
        if visit is None or visit.end_s is not None:
            return
        visit.clearance_m = min(visit.clearance_m, record.truth.clearance_m)
        if node.startswith("go_"):
            visit.reason = record.feedback
        elif node.startswith(("there_", "missed_")):
            visit.end_s, visit.reached = record.time_s, node.startswith("there_")
            visit.error_m = math.dist(visit.place, (pose.x_m, pose.y_m))


def places_of(scene: Scene, count: int, seed: int) -> list[tuple[float, float]]:
    """Return random free places of a scene, in its drawing."""
    rng = np.random.default_rng(seed)
    half_m = np.array(scene.ground.size_m) / 2 - FREE_M
    found: list[tuple[float, float]] = []
    while len(found) < count:
        x_m, y_m = map(float, rng.uniform(-half_m, half_m))
        others = [box.footprint.distance_m(x_m, y_m) for box in scene.boxes]
        others += [mover.distance_m(x_m, y_m) for mover in scene.movers]
        if min(others, default=math.inf) >= FREE_M:
            found.append((x_m, y_m))
    return found


def mission_of(places: list[tuple[float, float]], take_off: Pose2D) -> str:
    """Return the text of a tree that visits places in turn, and lands."""
    visits = []
    for index, (x_m, y_m) in enumerate(places):
        there = lab_to_start(Pose2D(x_m=x_m, y_m=y_m, yaw_rad=0.0), take_off)
        visits.append(f"""
        <Fallback>
          <Sequence>
            <GoTo name="go_{index}" to="start:{there.x_m:.3f},{there.y_m:.3f}"/>
            <HoverFor name="there_{index}" seconds="0.5"/>
          </Sequence>
          <HoverFor name="missed_{index}" seconds="0.5"/>
        </Fallback>""")
    return in_flight("".join(visits) + '<SubTree ID="ComeHome"/>', gimbal_deg=-42)


def main() -> None:
    """Fly the missing flights and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--drone", default="twin")
    parser.add_argument("--scenes", default="val-a,val-b")
    parser.add_argument("--flights", type=int, default=2, help="in each scene")
    parser.add_argument("--seed-from", type=int, default=0)
    parser.add_argument("--places", type=int, default=5, help="in each flight")
    parser.add_argument("--movers", type=int, default=0)
    parser.add_argument("--faults", action="append", default=[], help="as of `uav-bt fly`")
    parser.add_argument("--profile", default="lab")
    parser.add_argument("--exact-masks", action="store_true")
    parser.add_argument("--image-size", default="640x360")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    path = given.out / FLIGHTS
    lines = path.read_text().splitlines() if path.exists() else []
    flown = [json.loads(line) for line in lines]
    for scene in given.scenes.split(","):
        for seed in range(given.seed_from, given.seed_from + given.flights):
            if not any(each["scene"] == scene and each["seed"] == seed for each in flown):
                flown.append(fly(scene, seed, given))
                with path.open("a") as file:
                    file.write(json.dumps(flown[-1]) + "\n")
    print_table(flown)


def fly(name: str, seed: int, given: argparse.Namespace) -> dict[str, object]:
    """Fly to some places of a scene and return the flight's line."""
    scene = load_scene(name)
    take_off = scene.take_off_pose or Pose(x_m=0.0, y_m=0.0, z_m=0.0, yaw_rad=0.0)
    places = places_of(scene, given.places, seed)
    log = VisitLog(places)
    width_px, height_px = map(int, given.image_size.split("x"))
    report = app.fly(
        mission_of(places, take_off),
        scene=name,
        seed=seed,
        drone=given.drone,
        movers=given.movers,
        faults=tuple(given.faults),
        profile=given.profile,
        exact_masks=given.exact_masks,
        image_size_px=(width_px, height_px),
        listeners=[lambda _: [log]],
    )
    visits = [asdict(visit) for visit in log.visits]
    outcome = {"outcome": report.outcome, "reason": report.reason, "duration_s": report.duration_s}
    return {"scene": name, "seed": seed, **outcome, "visits": visits}


def print_table(flown: list[dict[str, object]]) -> None:
    """Print the outcomes and the distribution of the errors."""
    visits = [Visit(**visit) for each in flown for visit in each["visits"]]  # type: ignore[attr-defined]
    ended = [visit for visit in visits if visit.end_s is not None]
    there = [visit for visit in ended if visit.reached]
    outcomes = [str(each["outcome"]) for each in flown]
    print(f"flights {len(flown)}, " + ", ".join(f"{o} {outcomes.count(o)}" for o in set(outcomes)))
    print(f"places {len(visits)}, reached {len(there)}, interrupted {len(visits) - len(ended)}")
    if there:
        errors_m = [visit.error_m for visit in there]
        rates = [
            (visit.end_s - visit.begin_s) / max(visit.apart_m / 0.6, 1.0)
            for visit in there
            if visit.end_s is not None
        ]
        print(
            f"error {np.median(errors_m):.3f} m (median), {np.percentile(errors_m, 95):.3f} (95 %)"
            f"; time over the straight line at 0.6 m/s {np.median(rates):.1f}"
        )
        print(f"least clearance {min(visit.clearance_m for visit in visits):.3f} m")
    for each in flown:
        for visit in (Visit(**visit) for visit in each["visits"]):  # type: ignore[attr-defined]
            if not visit.reached:
                print(f"  {each['scene']} {each['seed']}: {visit.place}, {visit.reason}")


if __name__ == "__main__":
    main()
