"""`uav-bt lab check`: score of a lab's segmentation network on picks that it did not learn from."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import click
from annotated_types import Ge, Le

from uav_bt.cli.declare import command
from uav_bt.cli.progress import progress_bars
from uav_bt.errors import MissionError, WeightsError
from uav_bt.files import writing
from uav_bt.inputs import refuse_inputs
from uav_bt.lab.classes import ROLE_NAMES
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import load_lab
from uav_bt.learning.flight_geometry import Geometry, compare_ranges, open_flight
from uav_bt.learning.lab_data import MaskSource, picks_of_lab, teacher_of_lab
from uav_bt.learning.lab_material import LabMaterial
from uav_bt.learning.pick_scores import PickScore, network_of_lab, score_picks, write_sheet
from uav_bt.option import Option
from uav_bt.record.reader import RecordReader
from uav_bt.tree.loading.lookup import shipped_trees


@command()
def check(
    ctx: click.Context,
    lab: Annotated[str, Option(form="LAB")],
    *,
    model: Annotated[
        Path | None,
        Option(
            "An ONNX network with the lab's classes; the one that the lab is flown with if not "
            "given.",
            path="read",
        ),
    ] = None,
    out: Annotated[
        Path | None, Option("Write the scores there too, as JSON.", path="written")
    ] = None,
    min_role_iou: Annotated[
        float,
        Ge(0),
        Le(1),
        Option("Exit with 1 if the intersection over union of a role is lower."),
    ] = 0.0,
    flights: Annotated[
        tuple[Path, ...],
        Option(
            "Compare the range of the mark in the record of a flight in the lab by its size and by "
            "the camera, too. Repeatable.",
            "--flight RECORD",
            path="read",
        ),
    ] = (),
) -> None:
    """Score the segmentation network of a lab on its held-out picks.

    LAB is a shipped lab, a folder of labs/, or a path. Scored are the picks on images whose use in
    frames.csv is 'check', from which the network did not learn; each pick is a sample. The teacher
    is scored beside the network. LAB/training/check.png shows the worst images: image, class map
    and picks, wrong ones with a red rim.

    With --flight the range of the landing mark is measured by its size, and by height and pitch. A
    wrong size, height or camera shows there and not in picks. A lab without picks or images is then
    checked by its flights only.
    """
    material = LabMaterial(lab=load_lab(lab))
    if out is not None:
        refuse_inputs(out, [material.lab.folder, *flights], shipped_trees())
    readers = [open_flight(path, material.lab) for path in flights]
    score: PickScore | None = None
    values: dict[str, Any] = {}
    picked = material.picks.exists() and material.frames.is_dir()
    if picked or not readers or min_role_iou > 0.0:
        score, values = _score(material, model)
    else:
        click.echo(f"not scored: {material.lab.folder} has no picks or no images")
    geometry = _geometry(material.lab, model, readers) if readers else None
    if out is not None:
        lengths = None if geometry is None else geometry.to_json()
        with writing(out):
            text = json.dumps({"lab": material.lab.name, **values, "geometry": lengths}, indent=2)
            out.write_text(text + "\n", encoding="utf-8")
        click.echo(f"scores: {out}")
    if score is not None and score.min_role_iou < min_role_iou:
        low = f"the IoU of a role is {score.min_role_iou:.3f}, below {min_role_iou:g}"
        click.echo(low, err=True)
        ctx.exit(MissionError.exit_code)


def _score(material: LabMaterial, model: Path | None) -> tuple[PickScore, dict[str, Any]]:
    """Score on picks, print the score, and return it, also as JSON values."""
    classes, uses = material.lab.classes, material.uses()
    picks = [pick for pick in picks_of_lab(material, uses) if uses[pick.image] == "check"]
    segment, teacher = network_of_lab(material.lab, model).ids, _teacher(material)
    beside = None
    with progress_bars() as advance:
        score = score_picks(segment, picks, material.frames, classes, advance=advance)
        if teacher is not None:
            try:
                beside = score_picks(teacher.load(), picks, material.frames, classes)
            except WeightsError as error:  # the score of the network does not depend on it
                click.echo(f"teacher: not scored ({error})", err=True)
    for line in score_lines(score):
        click.echo(line)
    if beside is not None:
        click.echo(
            f"teacher: {beside.total.accuracy:.3f} of the picks right, IoU of the roles "
            f"{beside.total.role_miou:.3f}"
        )
    sheet = material.training / "check.png"
    write_sheet(score, segment, material.frames, sheet)
    click.echo(f"worst images: {sheet}")
    return score, {**score.to_json(), "teacher": None if beside is None else beside.to_json()}


def _geometry(lab: Lab, model: Path | None, flights: Sequence[RecordReader]) -> Geometry:
    """Compare ranges of the mark in flights, print the result, and return it."""
    with progress_bars() as advance:
        geometry = compare_ranges(flights, lab, network_of_lab(lab, model), advance=advance)
    for line in geometry.lines(lab.file):
        click.echo(line)
    return geometry


def _teacher(material: LabMaterial) -> MaskSource | None:
    file = material.teacher
    trained = MaskSource(file=file, classes=material.lab.classes) if file.is_file() else None
    return teacher_of_lab(material) or trained


def score_lines(score: PickScore) -> Iterator[str]:
    """Yield the lines that describe a score on picks."""
    total, counts = score.total, score.picks
    held_out = sum(counts.values())
    yield f"{held_out} held-out picks on {total.images} images: {total.accuracy:.3f} right"
    in_roles = dict(zip(ROLE_NAMES, total.role_counts.sum(axis=1).tolist(), strict=True))
    for what, each, ious in (("role", in_roles, total.role_iou), ("class", counts, total.iou)):
        yield f"{what:<18}{'picks':>6}{'IoU':>8}"
        for (name, count), iou in zip(each.items(), ious, strict=True):
            yield f"  {name:<16}{count:>6}{f'{iou:.3f}' if count else '-':>8}"
    for true, taken, share in score.confusions():
        yield f"{true} taken for {taken}: {100 * share:.0f} % of its picks"
    if score.unchecked:
        yield f"unchecked, because without held-out picks: {', '.join(score.unchecked)}"
    wrong = [each for each in score.images if each.wrong][:5]
    if wrong:
        texts = (f"{each.image} ({each.wrong} of {len(each.picks)})" for each in wrong)
        yield f"most wrong picks: {', '.join(texts)}"
