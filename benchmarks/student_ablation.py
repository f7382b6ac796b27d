r"""What each part of the control student's training is worth, off line and in flight.

    uav-bt net collect explore_and_land_advised --out runs/c0  # the rule flies
    uav-bt net collect explore_and_land_student_advised --student S --out runs/c1  # the student
    uav-bt net collect explore_and_land_advised --scene val-a --scene val-b --flights 8 \
        --out runs/cv
    python benchmarks/student_ablation.py runs/c0 runs/c1 --validate runs/cv --out runs/ablation

Each variant trains for equally many steps, is scored on the held-out records, and flies the mission
unguarded on the validation scenes, the same seeds for all. The first folder is the rule's own
flights: the variant without aggregation learns from it alone. What was done before is not done
again, so a run that was stopped goes on with the same command; `--only` with `--threads 1
--workers 1` shares the variants out between processes.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import fmean
from typing import Any, Final

import torch

from perception.control.ego_state import ControlNetConfig
from perception.control.training.network import STUDENT_FILES
from perception.control.training.run import ControlTrainingConfig
from perception.control.training.samples import SampleConfig
from uav_bt import campaign as campaigns
from uav_bt.campaign.report.statistics import wilson
from uav_bt.campaign.runner import LocalBackend
from uav_bt.learning.collecting import nodes_under_policy
from uav_bt.learning.dataset import read_advised_flights, split_records
from uav_bt.learning.training import UNET_WEIGHTS, train_student

TREE: Final = "explore_and_land_student"


@dataclass(frozen=True, kw_only=True)
class Variant:
    """One way to train."""

    net: ControlNetConfig = field(default_factory=ControlNetConfig)
    near_weight: float = 2.0
    aggregated: bool = True


VARIANTS: Final[Mapping[str, Variant]] = {
    "as it ships": Variant(),
    "without aggregation": Variant(aggregated=False),
    "no history": Variant(net=ControlNetConfig(views=1)),
    "history 1 s apart": Variant(net=ControlNetConfig(spacing_s=1.0)),
    "history 2 s apart": Variant(net=ControlNetConfig(spacing_s=2.0)),
    "no weight on near obstacles": Variant(near_weight=1.0),
}


def _trained(variant: Variant, home: Path, arguments: argparse.Namespace) -> Mapping[str, Any]:
    """Train a variant unless that is done; return its score on the held-out flights."""
    weights = home / "student.safetensors"
    if not weights.with_suffix(".onnx").is_file():
        folders = arguments.records if variant.aggregated else arguments.records[:1]
        records, held_out = split_records(folders, arguments.validate)
        kept = arguments.views_kept or arguments.out / "views"
        config = ControlTrainingConfig(
            steps=arguments.steps, samples=SampleConfig(near_weight=variant.near_weight)
        )
        train_student(
            read_advised_flights(records, variant.net, kept),
            weights,
            config=config,
            net_config=variant.net,
            start=UNET_WEIGHTS,
            checkpoint=home / "checkpoint.safetensors",
            held_out=read_advised_flights(held_out, variant.net, kept),
        )
    score: Mapping[str, Any] = STUDENT_FILES.load(weights)[1]["validation"]
    return score


def _flown(home: Path, arguments: argparse.Namespace) -> Sequence[Mapping[str, Any]]:
    """Fly a variant's student; return the flights' reports."""
    policy = f"student:{(home / 'student.onnx').resolve()}"
    plan = campaigns.make_plan(
        [TREE],
        scenes=["val-*"],
        flights=arguments.flights,
        policies=dict.fromkeys(nodes_under_policy(TREE), policy),
    )
    result = campaigns.run(plan, home / "flights", backend=LocalBackend(arguments.workers))
    return result.flights


def _row(name: str, score: Mapping[str, Any], flights: Sequence[Mapping[str, Any]]) -> str:
    """Return a variant's line of the table."""
    outcomes = Counter(flight["outcome"] for flight in flights)
    explored_m = fmean(flight["explore_distance_m"] for flight in flights)
    clearance_m = fmean(flight["min_clearance_m"] for flight in flights)
    count, landed = sum(outcomes.values()), outcomes.get("success", 0)
    low, high = wilson(landed, count)
    others = ", ".join(f"{many} {what}" for what, many in outcomes.items() if what != "success")
    shares = (score["missed"], score["stopped"], score["wrong_side"])
    return (
        f"| {name} | {' | '.join(f'{100 * share:.1f}' for share in shares)} | "
        f"{score['step_error_m']:.3f} | {score['movement_mse']:.4f} | "
        f"{landed} of {count} ({100 * low:.0f} to {100 * high:.0f} %) | {others or 'none'} | "
        f"{explored_m:.1f} | {clearance_m:.2f} |"
    )


def main(words: Sequence[str] | None = None) -> None:
    """Train, score and fly every variant; print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("records", nargs="+", type=Path, help="folders; the rule's flights first")
    parser.add_argument("--validate", nargs="+", type=Path, required=True)
    parser.add_argument("--views-kept", type=Path, help="views that `train student` kept")
    parser.add_argument("--steps", type=int, default=2500)
    parser.add_argument("--flights", type=int, default=10, help="in each validation scene")
    parser.add_argument("--threads", type=int, help="that train; torch's choice by default")
    parser.add_argument("--workers", type=int, help="flights at a time; all cores by default")
    parser.add_argument("--only", nargs="+", choices=list(VARIANTS), default=list(VARIANTS))
    parser.add_argument("--out", type=Path, default=Path("runs/student_ablation"))
    arguments = parser.parse_args(words)
    if arguments.threads:
        torch.set_num_threads(arguments.threads)
    print("| variant | missed, % | stopped, % | wrong side, % | step error, m |", end="")
    print(" movement MSE | success | failures | explored, m | smallest clearance, m |")
    print(f"|{'---|' * 10}", flush=True)
    for name in arguments.only:
        variant = VARIANTS[name]
        home = arguments.out / name.replace(" ", "_")
        home.mkdir(parents=True, exist_ok=True)
        score = _trained(variant, home, arguments)
        print(_row(name, score, _flown(home, arguments)), flush=True)


if __name__ == "__main__":
    main()
