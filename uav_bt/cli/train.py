"""`uav-bt train`: make the weights that missions fly on."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Final

import click

from uav_bt.cli.options import output_option, seed_option, views_option
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.train_student import student
from uav_bt.plugins import need

__all__ = ["train"]

_RUNS: Final = Path("runs")  # where results go by default; git does not look there


@click.group()
def train() -> None:
    """Train the networks that missions fly on."""


train.add_command(student)


@train.command()
@output_option("--out", f"The safetensors file; {_RUNS}/teacher.safetensors if not given.")
@click.option(
    "--picks",
    type=click.Path(path_type=Path),
    help="Learn from the picks of this file instead of drawing them from the twin.",
)
@click.option(
    "--photographs",
    type=click.Path(path_type=Path),
    help="The folder of the photographs that --picks is about.",
)
@views_option(60)
@seed_option()
@click.option(
    "--total",
    type=click.IntRange(min=1),
    default=6500,
    show_default=True,
    help="Picks that are drawn in all.",
)
def teacher(
    *,
    out: Path | None,
    picks: Path | None,
    photographs: Path | None,
    scenes: tuple[str, ...],
    views: int,
    seed: int,
    total: int,
) -> None:
    """Train the teacher on picks: drawn from the twin, or clicked by a person."""
    weights = out or _RUNS / "teacher.safetensors"
    if (photographs is None) != (picks is None):
        raise click.UsageError("--picks and --photographs belong together")
    from perception.segmentation.teacher import TeacherConfig, save_teacher  # noqa: PLC0415
    from uav_bt.learning import segmentation as training  # noqa: PLC0415
    from uav_bt.learning.scenes import TRAINING_SCENES  # noqa: PLC0415
    from uav_bt.learning.views import ViewPlan  # noqa: PLC0415

    config = TeacherConfig()
    if picks is not None and photographs is not None:
        trained = training.train_teacher_on_photographs(picks, photographs, config)
    else:
        plan = ViewPlan(scenes=scenes or TRAINING_SCENES, views=views, seed=seed)
        with progress_bars() as advance:
            drawn = training.draw_twin_picks(plan, config, total=total, advance=advance)
            trained = training.train_teacher(drawn, plan, config, advance=advance)
    save_teacher(weights, trained)
    click.echo(f"teacher of {len(trained.known)} classes: {weights}")


@train.command()
@click.argument("flights", nargs=-1, metavar="[FLIGHTS]...", type=click.Path(path_type=Path))
@output_option("--out", f"The safetensors file; {_RUNS}/unet.safetensors if not given.")
@click.option(
    "--teacher",
    "teacher_path",
    type=click.Path(path_type=Path),
    help="Whose masks are learnt; the shipped teacher's if not given.",
)
@click.option(
    "--run",
    type=click.Path(file_okay=False, path_type=Path),
    default=_RUNS / "segmentation",
    show_default=True,
    help="Where masks and checkpoint are kept: the same command again goes on from there.",
)
@views_option(875)
@seed_option(1)
@click.option(
    "--steps", type=click.IntRange(min=1), default=4000, show_default=True, help="Of training."
)
@click.option(
    "--loss",
    type=click.Choice(["cross_entropy", "bce_dice"]),
    default="cross_entropy",
    show_default=True,
    help="What is minimised.",
)
@click.option(
    "--workers",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    help="Processes that make masks.",
)
def segmentation(
    *,
    flights: tuple[Path, ...],
    out: Path | None,
    teacher_path: Path | None,
    run: Path,
    scenes: tuple[str, ...],
    views: int,
    seed: int,
    steps: int,
    loss: str,
    workers: int,
) -> None:
    """Train the U-Net on the teacher's masks.

    FLIGHTS are records of `uav-bt fly --record`: their pictures are learnt from, one a second.
    Without any, pictures are drawn in the twin (--scene, --views, --seed).

    Writes a safetensors file and, beside it, the ONNX file made from it. A mission flies on the
    latter when its tree says <Segment model="FILE.onnx"/>.
    """
    need("train", "torch", "onnx")
    weights = out or _RUNS / "unet.safetensors"
    if weights.suffix != ".safetensors":
        raise click.UsageError(f"--out must end in .safetensors, got '{weights}'")
    from perception.segmentation.teacher import load_teacher  # noqa: PLC0415 - late, for --help
    from perception.segmentation.training.run import TrainingConfig  # noqa: PLC0415
    from uav_bt.learning import segmentation as training  # noqa: PLC0415
    from uav_bt.learning.flight_labels import label_flights  # noqa: PLC0415
    from uav_bt.learning.scenes import TRAINING_SCENES  # noqa: PLC0415
    from uav_bt.learning.views import ViewPlan  # noqa: PLC0415

    teacher_path = training.SHIPPED_TEACHER if teacher_path is None else teacher_path
    load_teacher(teacher_path)  # refuses a damaged one now, and not in a worker later
    plan = training.StudentPlan(
        views=ViewPlan(scenes=scenes or TRAINING_SCENES, views=views, seed=seed)
    )
    config = TrainingConfig(steps=steps, loss=loss)  # type: ignore[arg-type]  # click checked it
    with progress_bars() as advance:
        masks = run / f"masks-{_fingerprint(plan, teacher_path)}"
        if flights:
            pictures = label_flights(teacher_path, flights, plan, masks, advance=advance)
        else:
            pictures = training.label_pictures(
                teacher_path, plan, masks, workers=workers, advance=advance
            )
        training.train_segmentation(
            pictures,
            weights,
            config=config,
            checkpoint=run / "checkpoint.safetensors",
            advance=advance,
        )
    click.echo(f"segmentation U-Net: {weights} and {weights.with_suffix('.onnx')}")


@train.command()
@click.argument(
    "flights", nargs=-1, required=True, metavar="FLIGHTS...", type=click.Path(path_type=Path)
)
@output_option("--out", f"The safetensors file; {_RUNS}/depth.safetensors if not given.")
@click.option(
    "--run",
    type=click.Path(file_okay=False, path_type=Path),
    default=_RUNS / "depth",
    show_default=True,
    help="Where labels, checkpoint, scores and pictures are kept: the same command again goes on.",
)
@click.option(
    "--labels",
    type=click.Choice(["footing", "none"]),
    default="footing",
    show_default=True,
    help="Beside the frames: depth from masks and geometry, or nothing.",
)
@click.option(
    "--pose",
    type=click.Choice(["telemetry", "network"]),
    default="telemetry",
    show_default=True,
    help="Where the camera's movement comes from.",
)
@click.option(
    "--photometric/--no-photometric",
    default=True,
    show_default=True,
    help="Let neighbouring frames teach, too.",
)
@click.option(
    "--start",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Weights of a depth network to begin with; random ones if not given.",
)
@click.option(
    "--validate/--no-validate",
    default=True,
    show_default=True,
    help="Score the network on the twin's validation scenes as it learns.",
)
@seed_option()
@click.option(
    "--steps", type=click.IntRange(min=1), default=2500, show_default=True, help="Of training."
)
def depth(
    *,
    flights: tuple[Path, ...],
    out: Path | None,
    run: Path,
    labels: str,
    pose: str,
    photometric: bool,
    start: Path | None,
    validate: bool,
    seed: int,
    steps: int,
) -> None:
    """Train the depth network on flights, without the true depth.

    FLIGHTS are records of `uav-bt fly --record`. Writes a safetensors file and, beside it, the ONNX
    file made from it, which a tree file may name.
    """
    need("train", "torch", "onnx")
    weights = out or _RUNS / "depth.safetensors"
    if weights.suffix != ".safetensors":
        raise click.UsageError(f"--out must end in .safetensors, got '{weights}'")
    if not photometric and labels == "none":
        raise click.UsageError("--no-photometric with --labels none leaves nothing to learn from")
    from perception.depth.training.config import DepthTrainingConfig  # noqa: PLC0415 - late, for --help
    from perception.segmentation.runtime import shipped_unet  # noqa: PLC0415
    from uav_bt.learning import depth as training  # noqa: PLC0415

    config = DepthTrainingConfig(
        steps=steps,
        seed=seed,
        pose=pose,  # type: ignore[arg-type]  # click checked it
        photometric=1.0 if photometric else 0.0,
        geometry=0.1 if photometric else 0.0,
        labels=1.0 if labels == "footing" else 0.0,
    )
    with progress_bars() as advance:
        read = training.read_flights(
            flights, shipped_unet() if labels == "footing" else None, run, advance=advance
        )
        score = training.train_depth(
            read,
            weights,
            config=config,
            start=start,
            checkpoint=run / "checkpoint.safetensors",
            views=training.depth_views(training.DepthViewPlan()) if validate else None,
            diary=training.Diary(run) if validate else None,
            advance=advance,
        )
    if score is not None:
        click.echo(
            f"validation: {score.abs_rel:.4f} relative error after median scaling, obstacles "
            f"{score.obstacle_error_m:.3f} m and carpet {score.carpet_error_m:.3f} m off with the "
            "carpet's scale"
        )
    click.echo(f"depth network: {weights} and {weights.with_suffix('.onnx')}")


def _fingerprint(plan: object, teacher_path: Path) -> str:
    """Return a name for the masks of a plan, so that other masks are never taken for them."""
    about = json.dumps(asdict(plan), sort_keys=True)  # type: ignore[call-overload]  # a dataclass
    return hashlib.sha256(about.encode() + teacher_path.read_bytes()).hexdigest()[:12]
