"""What each part of the survey is worth: the same flights without it.

    python benchmarks/survey_ablation.py --scenes val-a,val-b --flights 4 --out runs/survey
    python benchmarks/survey_ablation.py --variants survey --movers 2 --out runs/movers

Exact masks at 320x180 and no depth, so that only mapping, planning and holding differ. Flights are
kept as lines in DIR/flights.jsonl, and those that are there are not flown again.

`survey`     as it ships: the leg with the most new ground in a second
`nearest`    the nearest leg with new ground at its end, as a frontier explorer would choose
`unmatched`  dead reckoning only: nothing that is seen again corrects the map
`unheld`     without position hold
`random`     the next heading is drawn at random whenever the way ahead ends
`rule`       no map's planning: the segmentation rule explores
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from mission_text import cover_or_turn, explore_and_come_home

from behaviours.perceive.site_map import MapSite
from behaviours.policies.coverage_policy import CoveragePolicy
from perception.mapping.registration import RegistrationConfig
from perception.mapping.site_mapper import SiteMapperConfig
from uav_bt import app
from uav_bt.answers import Advance, Answer, Blocked
from uav_bt.errors import UavBtError
from uav_bt.mission.hold_model import HoldConfig
from uav_bt.protocols import LeafPolicy, PolicyView
from uav_bt.tree import NodeRegistry
from uav_bt.types import NearObstacles

SURVEY_S = 180
FLIGHTS = "flights.jsonl"


class MapUnmatched(MapSite):
    """The map without scan matching: the odometry is believed to be without drift."""

    mapping = SiteMapperConfig(
        registration=RegistrationConfig(walk_m=0.0, blind_walk_m=0.0, walk_rad=0.0)
    )


class RandomRule:
    """Ahead while there is room in the map of obstacles, else a turn drawn at random."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)

    def decide(self, view: PolicyView) -> Answer:
        """Return a step of 0.5 m, or a turn of up to half a circle."""
        near = NearObstacles() if view.site_map is None else view.site_map.near
        free = view.site_map is not None and near.allows(0.5, margin_m=0.55)
        ends, edges = near.ends_within(0.4) > 1, near.edges_m
        ahead = (edges[:, 0] > 0.0) & (np.abs(edges[:, 1]) < 0.4) & (edges[:, 0] < 1.0)
        if free and not ends and not ahead.any():
            return Advance(forward_m=0.5, reason="clear")
        return Blocked(yaw_rad=float(self._rng.uniform(-np.pi, np.pi)), reason="random")


@dataclass(frozen=True, kw_only=True)
class Variant:
    """How one kind of flight differs from the survey as it ships."""

    explore: str = "coverage"
    mapper: str = "MapSite"
    hold: HoldConfig = field(default_factory=HoldConfig)

    def policies(self, seed: int) -> dict[str, LeafPolicy]:
        """Return the policies that are no plug-ins, by name."""
        return {
            "nearest": CoveragePolicy(value=lambda _, time_s: -time_s),
            "random": RandomRule(seed),
        }

    def tree(self) -> str:
        """Return the mission as the text of a tree file."""
        by_map = self.explore not in {"segmentation", "random"}
        return explore_and_come_home(
            explore=cover_or_turn(self.explore, by_map=by_map),
            explore_s=SURVEY_S,
            home=f'<ReturnToBase gives_way="{"true" if by_map else "false"}"/>',
            gimbal_deg=-42 if self.explore != "segmentation" else -30,
            mapper=self.mapper,
        )


VARIANTS = {
    "survey": Variant(),
    "nearest": Variant(explore="nearest"),
    "unmatched": Variant(mapper="MapUnmatched"),
    "unheld": Variant(hold=HoldConfig(blind_s=0.0)),
    "random": Variant(explore="random"),
    "rule": Variant(explore="segmentation"),
}


def fly(name: str, scene: str, seed: int, profile: str, movers: int) -> dict[str, object]:
    """Fly one variant and return its line."""
    variant, text = VARIANTS[name], VARIANTS[name].tree()
    policy = variant.policies(seed).get(variant.explore)
    if policy is not None:  # it has no name that a file could use
        text = text.replace(f'policy="{variant.explore}"', 'policy="coverage"')
    options = app.FlightOptions(
        scene=scene,
        seed=seed,
        profile=profile,
        movers=movers,
        exact_masks=True,
        image_size_px=(320, 180),
        policies={} if policy is None else {"Explore": policy, "Avoid": policy},
        runner=app.RunnerConfig(hold=variant.hold),
    )
    registry = NodeRegistry.installed().with_nodes(MapUnmatched)
    report = app.fly(text, options, registry=registry)
    return {
        "variant": name,
        "scene": scene,
        "seed": seed,
        "profile": profile,
        "movers": movers,
        "outcome": report.outcome,
        "reason": report.reason,
        "duration_s": report.duration_s,
        "passed_90s": report.coverage_passed_90s,
        "seen_90s": report.coverage_seen_90s,
        "passed": next(
            (p for t, p, _ in reversed(report.coverage_curve) if t <= SURVEY_S),
            report.coverage_passed,
        ),
        "clearance_m": report.min_clearance_m,
        "flown_m": report.total_distance_m,
    }


def lines(file: Path) -> Iterator[dict[str, object]]:
    """Yield the flights that a file has."""
    if file.is_file():
        for line in file.read_text(encoding="utf-8").splitlines():
            yield json.loads(line)


def table(file: Path) -> None:
    """Print a row for each variant."""
    print(
        "variant    flights success  passed 90 s (5 %)  180 s  seen 90 s  nearest m  flown m  "
        "contacts/h"
    )
    flights = list(lines(file))
    for name in VARIANTS:
        mine = [flight for flight in flights if flight["variant"] == name]
        if not mine:
            continue
        good = sum(flight["outcome"] == "success" for flight in mine)

        def column(key: str, mine: list[dict[str, object]] = mine) -> list[float]:
            return [float(str(flight[key])) for flight in mine if flight[key] is not None]

        contacts = sum(flight["outcome"] == "collision" for flight in mine)
        early = column("passed_90s") or [float("nan")]
        print(
            f"{name:10s} {len(mine):7d} {good:7d} {np.mean(early):9.2f} "
            f"({np.percentile(early, 5):.2f}) {np.mean(column('passed')):10.2f} "
            f"{np.mean(column('seen_90s') or [float('nan')]):10.2f} "
            f"{np.mean(column('clearance_m')):10.2f} {np.mean(column('flown_m')):8.1f} "
            f"{3600 * contacts / max(sum(column('duration_s')), 1.0):10.1f}"
        )


def main() -> None:
    """Fly what is missing, then print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", default="val-a,val-b")
    parser.add_argument("--flights", type=int, default=4)
    parser.add_argument("--seed-from", type=int, default=0)
    parser.add_argument("--profile", default="lab")
    parser.add_argument("--movers", type=int, default=0, help="in each scene")
    parser.add_argument("--variants", default=",".join(VARIANTS))
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    file = given.out / FLIGHTS
    done = {(f["variant"], f["scene"], f["seed"], f["profile"], f["movers"]) for f in lines(file)}
    for seed in range(given.seed_from, given.seed_from + given.flights):
        for scene in given.scenes.split(","):
            for name in given.variants.split(","):
                if (name, scene, seed, given.profile, given.movers) in done:
                    continue
                try:
                    line = fly(name, scene, seed, given.profile, given.movers)
                except UavBtError as error:
                    parser.exit(2, f"{error}\n")
                with file.open("a", encoding="utf-8") as kept:
                    kept.write(json.dumps(line) + "\n")
    table(file)


if __name__ == "__main__":
    main()
