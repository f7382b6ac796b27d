"""Options of the commands that train, export and evaluate networks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import click

from uav_bt.cli.flight_options import flight_option
from uav_bt.cli.options import FOLDER, RUNS, Decorator, grouped
from uav_bt.cli.values import WholeNumber
from uav_bt.learning.views import DepthViewPlan, ViewPlan

Plan = TypeVar("Plan", ViewPlan, DepthViewPlan)


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """Which images the twin draws.

    Attributes:
        scenes: Names or files of the scenes. Empty: the plan's.
        views: Number of images of each scene.
        seed: Seed of everything random.
    """

    scenes: tuple[str, ...]
    views: int
    seed: int

    def of(self, plan: Plan) -> Plan:
        """Return a plan with these values."""
        scenes = self.scenes or plan.scenes
        return replace(plan, scenes=scenes, views=self.views, seed=self.seed)


def drawn_options(views: int, seed: int = 0) -> Decorator:
    """Return the options for which images the twin draws, as the parameter `drawn`.

    Args:
        views: images of each scene without the option.
        seed: without the option.
    """
    return grouped(
        "drawn",
        Drawn,
        scenes=click.option(
            "--scene",
            "scenes",
            metavar="SCENE",
            multiple=True,
            help="Draw images of this scene, by name or file, not of the default ones. Repeatable.",
        ),
        views=click.option(
            "--views",
            type=WholeNumber(min=1),
            default=views,
            help="Images of each scene.",
        ),
        seed=flight_option("seed", default=seed),
    )


def run_option(name: str, content: str) -> Decorator:
    """Return the option for the folder of a training.

    Args:
        name: of its default, a folder in `RUNS`.
        content: Description of the folder's content.
    """
    return click.option(
        "--run",
        metavar="DIR",
        type=FOLDER,
        default=RUNS / name,
        help=f"Where {content} are kept; the same command continues a training from there.",
    )


def device_option() -> Decorator:
    """Return the option for the device that a network is trained on."""
    return click.option(
        "--device",
        type=click.Choice(["cpu", "cuda"]),
        default="cpu",
        help="Where PyTorch trains; 'cuda' needs a GPU and a PyTorch built for it.",
    )


def batch_option(default: int, what: str) -> Decorator:
    """Return the option for the size of a batch; `what` it is made of."""
    return click.option(
        "--batch",
        type=WholeNumber(min=2),
        default=default,
        help=f"{what} in a step.",
    )


def steps_option(default: int) -> Decorator:
    """Return the option for the steps of a training."""
    return click.option(
        "--steps",
        type=WholeNumber(min=1),
        default=default,
        help="Steps of training.",
    )
