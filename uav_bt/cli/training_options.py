"""Options of the commands that train, export and evaluate networks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from annotated_types import Ge

from uav_bt.app.option_values import Seed
from uav_bt.learning.views import DepthViewPlan, ViewPlan
from uav_bt.option import Option

Plan = TypeVar("Plan", ViewPlan, DepthViewPlan)

Steps = Annotated[int, Ge(1), Option("Steps of training.")]
Device = Annotated[
    Literal["cpu", "cuda"],
    Option("Where PyTorch trains; 'cuda' needs a GPU and a PyTorch built for it."),
]
Weights = Annotated[Path, Option("The weights.", path="written", suffix=".safetensors")]


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """Which images the twin draws; without scenes those of the plan."""

    scenes: Annotated[
        tuple[str, ...],
        Option(
            "Draw images of this scene, by name or file, not of the default ones. Repeatable.",
            "--scene SCENE",
        ),
    ] = ()
    views: Annotated[int, Ge(1), Option("Images of each scene.")] = 50
    seed: Seed = 5

    def of(self, plan: Plan) -> Plan:
        """Return a plan with these values."""
        scenes = self.scenes or plan.scenes
        return replace(plan, scenes=scenes, views=self.views, seed=self.seed)
