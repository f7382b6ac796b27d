"""`uav-bt net train` and `net collect`: the depth network, the control student and its flights."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, Literal

import click
from annotated_types import Ge, Gt, Le

from perception.control.ego_state import ControlNetConfig
from perception.control.training.run import ControlTrainingConfig
from perception.depth.training.run import DepthTrainingConfig
from perception.segmentation.runtime import shipped_unet
from uav_bt.app.option_values import ImageSize, Policies, Seed
from uav_bt.campaign.runner import LocalBackend
from uav_bt.cli.declare import command
from uav_bt.cli.progress import campaign_progress, progress_bars
from uav_bt.cli.shared import RUNS, Records, Workers
from uav_bt.cli.training_options import Device, Steps, Weights
from uav_bt.errors import FileError, MissionError
from uav_bt.learning import collecting, training
from uav_bt.learning.dataset import read_advised_flights, read_flights, records_of
from uav_bt.learning.lab_training import UNET_WEIGHTS
from uav_bt.learning.views import TRAINING_SCENES
from uav_bt.option import Option
from uav_bt.plugins import need

_NO_POLICIES: Final[dict[str, str]] = {}


@command()
def depth(
    flights: Annotated[tuple[Path, ...], Option(form="FLIGHTS...")],
    *,
    out: Weights = RUNS / "depth.safetensors",
    run: Annotated[
        Path,
        Option(
            "Where labels and checkpoint are kept; the same command continues a training from "
            "there.",
            path="folder",
        ),
    ] = RUNS / "depth",
    labels: Annotated[
        Literal["contact", "none"],
        Option("Labels beside the frames: depth from masks and geometry, or none."),
    ] = "contact",
    photometric: Annotated[
        bool, Option("Learn from the photometric loss between neighbouring frames, too.")
    ] = True,
    start: Annotated[
        Path | None,
        Option("Weights of a depth network to begin with; random ones if not given.", path="read"),
    ] = None,
    pose: Annotated[
        Literal["telemetry", "network"], Option("Source of the camera's movement between frames.")
    ] = "telemetry",
    seed: Seed = 0,
    steps: Steps = 2500,
    device: Device = "cpu",
) -> None:
    """Train the depth network on flights, without the true depth.

    FLIGHTS are records of `uav-bt fly --record`. Writes a safetensors file and, beside it, the ONNX
    file made from it, which a tree file may name.
    """
    if not photometric and labels == "none":
        raise click.UsageError("--no-photometric with --labels none leaves nothing to learn from")
    config = DepthTrainingConfig(
        pose=pose, seed=seed, steps=steps, device=device, photometric=photometric
    )
    with progress_bars() as advance:
        segmenter = shipped_unet() if labels == "contact" else None
        training.train_depth(
            read_flights(flights, segmenter, run, advance=advance),
            out,
            config=config,
            start=start,
            checkpoint=run / "checkpoint.safetensors",
            advance=advance,
        )
    click.echo(f"depth network: {out} and {out.with_suffix('.onnx')}")


@command()
def student(
    records: Records,
    *,
    out: Weights = RUNS / "student.safetensors",
    run: Annotated[
        Path,
        Option(
            "Where views and checkpoint are kept; the same command continues a training from "
            "there.",
            path="folder",
        ),
    ] = RUNS / "student",
    views_kept: Annotated[
        Path | None,
        Option(
            "Where the records' views are kept, for several runs to share; RUN/views if not given.",
            path="folder",
        ),
    ] = None,
    views: Annotated[
        int, Ge(1), Le(5), Option("Frames in a window: the present one and earlier ones.")
    ] = 3,
    spacing_s: Annotated[float, Gt(0), Option("Time between the views of a window.")] = 0.5,
    start: Annotated[
        Path | None,
        Option(
            "Weights to begin with, a student's or a segmentation U-Net's; the shipped U-Net's if "
            "not given.",
            path="read",
        ),
    ] = None,
    near_weight: Annotated[
        float, Gt(0), Option("How much more often views near obstacles are drawn than others.")
    ] = 2.0,
    seed: Seed = 0,
    steps: Steps = 6000,
    batch: Annotated[int, Ge(2), Option("Windows in a step.")] = 24,
    device: Device = "cpu",
) -> None:
    """Train the control student on records of advised flights.

    RECORDS are files that `uav-bt net collect` made, or folders of them. Writes a safetensors file
    and, beside it, the ONNX file made from it, for a tree with policy="student:FILE.onnx". On two
    cores 4,500 steps take about 36 minutes; the same command continues what was stopped.
    """
    # Refuses an absent GPU before records are read.
    loop = ControlTrainingConfig(
        near_weight=near_weight, seed=seed, steps=steps, batch=batch, device=device
    )
    net = ControlNetConfig(views=views, spacing_s=spacing_s)
    kept = views_kept or run / "views"
    with progress_bars() as advance:
        training.train_student(
            read_advised_flights(records_of(records), net, kept, advance=advance),
            out,
            config=loop,
            net_config=net,
            start=start or UNET_WEIGHTS,
            checkpoint=run / "checkpoint.safetensors",
            advance=advance,
        )
    click.echo(f"control student: {out} and {out.with_suffix('.onnx')}")


@command()
def collect(
    ctx: click.Context,
    tree: str,
    *,
    flights: Annotated[
        int, Ge(1), Option("Minimum in all, shared evenly over scenes and profiles.")
    ] = 96,
    scenes: Annotated[
        tuple[str, ...],
        Option(
            "Scene to begin with, by name or file. Repeatable; default: all training scenes.",
            "--scene SCENE",
        ),
    ] = (),
    profiles: Annotated[
        tuple[Literal["ideal", "lab", "harsh", "lab-instant", "harsh-instant"], ...],
        Option("How imperfect the twin is. Repeatable; default: lab and harsh.", "--profile"),
    ] = (),
    layouts: Annotated[
        bool,
        Option(
            "Vary the boxes, too, in all flights but the first of each scene; light always varies."
        ),
    ] = True,
    seed: Seed = 0,
    image_size_px: ImageSize = (640, 360),
    student: Annotated[
        Path | None,
        Option(
            "Let this control student (ONNX) fly in place of every policy of the tree.", path="read"
        ),
    ] = None,
    policies: Policies = _NO_POLICIES,
    workers: Workers = None,
    out: Annotated[
        Path | None,
        Option("Where flights and records are kept; default: runs/collected-TREE.", path="folder"),
    ] = None,
) -> None:
    """Fly a mission many times and record the rule's advice on every view.

    TREE has an <Advise/> leaf: explore_and_land_advised, where the rule flies, or
    explore_and_land_student_advised, where the student flies and the rule's answers are
    recorded. `uav-bt net train student DIR...` learns from the records. The same command continues
    a collection that was stopped. A flight takes about 45 s of a core.
    """
    need("record")
    names = {node: str(policy) for node, policy in policies.items()}
    if student is not None:
        if not student.is_file():
            raise FileError(student, "there is no such control student")
        # Absolute: workers have another working directory.
        flying = collecting.nodes_under_policy(tree)
        names = {**dict.fromkeys(flying, f"student:{student.resolve()}"), **names}
    plan = collecting.CollectionPlan(
        tree=tree,
        policies=names,
        flights=flights,
        scenes=scenes or TRAINING_SCENES,
        profiles=profiles or ("lab", "harsh"),
        layouts=layouts,
        seed=seed,
        image_size_px=image_size_px,
    )
    folder = out or RUNS / f"collected-{Path(tree).stem}"
    with campaign_progress(len(plan)) as progress:
        try:
            records = collecting.collect(
                plan,
                folder,
                backend=LocalBackend(workers),
                on_flight=progress.add,
                on_note=progress.note,
            )
        except KeyboardInterrupt:
            progress.note(f"stopped; the same command continues from the files in {folder}")
            ctx.exit(MissionError.exit_code)
    size_mb = sum(record.stat().st_size for record in records) / 1e6
    click.echo(f"{len(records)} records, {size_mb:.0f} MB: {folder}")
