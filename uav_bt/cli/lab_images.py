"""`uav-bt lab film`, `frames`, `pick` and `check`: images of a lab, picks, scores on them."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import click
from annotated_types import Ge, Le

from perception.segmentation.training.pick_images import CHECK, TRAIN
from perception.segmentation.training.pick_server import make_pick_server
from perception.segmentation.training.pick_session import PickSession
from uav_bt.app.option_values import ImageSize
from uav_bt.cli.declare import command
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.shared import (
    RUNS,
    Count,
    InputFile,
    OutputFile,
    OutputFolder,
    table,
    write_scores,
)
from uav_bt.errors import InputError, WeightsError
from uav_bt.files import check_output
from uav_bt.inputs import refuse_inputs
from uav_bt.lab.classes import ROLE_NAMES
from uav_bt.lab.shipped import load_lab
from uav_bt.learning import lab_frames
from uav_bt.learning.flight_geometry import compare_ranges, open_flight
from uav_bt.learning.lab_data import MaskSource, picks_of_lab, teacher_of_lab
from uav_bt.learning.lab_material import LabMaterial
from uav_bt.learning.pick_scores import PickScore, network_of_lab, score_picks, write_sheet
from uav_bt.option import Option
from uav_bt.tree.loading.lookup import shipped_trees


@command()
def film(
    lab: str,
    *,
    scenes: Annotated[tuple[str, ...], Option(form="GLOB")] = (),
    movers: Annotated[int, Ge(0)] = 0,
    places: Count = 8,
    image_size_px: ImageSize = (1280, 720),
    out: OutputFolder = None,
) -> None:
    """Film a lab in the twin, as a person films a room with the drone.

    LAB is the lab, as --lab takes it; a lab of yours needs a scene. In each scene a pilot flies
    through the free ground, turns once at every place with another pitch of the camera, and films
    the landing mark from above. Each flight becomes a video, which `uav-bt lab frames` reads.

    Options:
        scenes: Scenes by name, file or pattern, with commas between. Repeatable; default: all of
            the lab.
        movers: Film so many people and carts, too, in a second flight of each scene. A lab whose
            kinds of objects do not move has no such flight.
        places: Places of each flight where the pilot turns.
        out: A new or empty folder for the videos; runs/LAB-video if not given.
    """
    from uav_bt.learning.lab_film import film_lab  # noqa: PLC0415  (MuJoCo takes long to import)

    found = load_lab(lab)
    how: dict[str, Any] = {"scenes": scenes, "movers": movers, "places": places}
    folder, films = out or RUNS / f"{found.name}-video", list[Path]()
    with progress_bars() as advance:
        for path in film_lab(found, folder, image_size_px=image_size_px, advance=advance, **how):
            click.echo(f"written: {path}")
            films.append(path)
    if movers and not any(path.stem.endswith("-movers") for path in films):
        click.echo(f"without movers: no kind of object of the lab '{found.name}' moves")
    click.echo(f"next: uav-bt lab frames {lab} {folder}")


@command()
def frames(
    lab: str,
    videos: Annotated[tuple[Path, ...], Option(form="VIDEOS...")],
    *,
    count: Count = lab_frames.DEFAULT_COUNT,
) -> None:
    """Take images of a place from videos: sharp ones that differ from each other.

    LAB is the lab, as --lab takes it. VIDEOS are video files of a phone or a drone, records of
    `uav-bt fly --record`, photographs, or folders of them. The images and a list of them
    (frames.csv) are written to the folder frames/ of the lab. A fifth of them is for checks: the
    network does not learn from those. Videos that were read before are left out, so the same
    command continues a run that was stopped, and further videos add images.

    Options:
        count: Most images of all videos together, shared by their durations.
    """
    with progress_bars() as advance:
        summary = lab_frames.take_frames(load_lab(lab), videos, count=count, advance=advance)
    _show(summary)
    if summary.refused:
        raise InputError("\n".join(summary.refused))


def _show(summary: lab_frames.FramesSummary) -> None:
    heads = ("source", "read", "blurred", "alike", "over count", "kept", "for check")
    rows = [
        (one.source, one.read, one.blurred, one.alike, one.surplus, one.kept, one.for_check)
        for one in summary.sources
    ]
    click.echo(table([heads, *rows]))
    for one in summary.sources:
        earlier = ["taken in an earlier run"] if one.earlier else []
        for note in (*earlier, *one.notes):
            click.echo(f"  {one.source}: {note}")
    for note in summary.notes:
        click.echo(f"skipped {note}")
    click.echo(f"images: {summary.total} in {summary.folder}")
    if summary.total < lab_frames.FEW:
        click.echo(
            f"Warning: {summary.total} images are few for a network, {lab_frames.FEW} are the "
            "least: film every part of the place from several heights and directions, and add the "
            "videos with the same command",
            err=True,
        )


@command()
def pick(lab: str, *, port: Annotated[int, Ge(0), Le(65535)] = 0) -> None:
    """Pick classes on the images of a lab, on a page in the browser.

    LAB is the name of a lab or its folder. Its images are those in frames/; each stroke is written
    to picks.csv in the folder of the lab. Call the command again to go on.

    `uav-bt lab train` learns from the picks.

    Options:
        port: Port of the page; 0 takes a free one.
    """
    material = LabMaterial(lab=load_lab(lab))
    uses = material.uses()
    check_output(material.picks)
    session = PickSession(material.frames, material.picks, material.lab.classes, uses)
    try:
        server = make_pick_server(session, port=port)
    except OSError as error:
        raise InputError(
            f"port {port} cannot be served ({error.strerror}): give another --port, or 0 for a "
            "free one"
        ) from error
    with server:
        click.echo(f"open http://127.0.0.1:{server.server_port}/ and pick; Ctrl-C when done")
        with contextlib.suppress(KeyboardInterrupt):
            server.serve_forever()
    each = ", ".join(f"{name} {count}" for name, count in session.counts().items())
    click.echo(f"{len(session.picks)} picks: {session.path} ({each})")
    picked = session.picked_images()
    click.echo(f"images with picks: {picked[TRAIN]} for training, {picked[CHECK]} for the check")
    click.echo(f"next: uav-bt lab train {lab}")


@command()
def check(
    lab: str,
    *,
    model: InputFile = None,
    out: OutputFile = None,
    min_role_iou: Annotated[float, Ge(0), Le(1)] = 0.0,
    flights: Annotated[tuple[Path, ...], Option(form="--flight RECORD", path="read")] = (),
) -> bool:
    """Score the segmentation network of a lab on its held-out picks.

    LAB is a shipped lab, a folder of labs/, or a path. Scored are the picks on images whose use in
    frames.csv is 'check', from which the network did not learn; each pick is a sample. The teacher
    is scored beside the network. LAB/training/check.png shows the worst images: image, class map
    and picks, wrong ones with a red rim.

    With --flight the range of the landing mark is measured by its size, and by height and pitch. A
    wrong size, height or camera shows there and not in picks. A lab without picks or images is then
    checked by its flights only.

    Options:
        model: An ONNX network with the lab's classes; the one that the lab is flown with if not
            given.
        out: Write the scores there too, as JSON.
        min_role_iou: Exit with 1 if the intersection over union of a role is lower.
        flights: Compare the range of the mark in the record of a flight in the lab by its size and
            by the camera, too. Repeatable.
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
    lengths = None
    if readers:
        network = network_of_lab(material.lab, model)
        with progress_bars() as advance:
            geometry = compare_ranges(readers, material.lab, network, advance=advance)
        click.echo("\n".join(geometry.lines(material.lab.file)))
        lengths = geometry.to_json()
    write_scores({"lab": material.lab.name, **values, "geometry": lengths}, out)
    if score is None or score.min_role_iou >= min_role_iou:
        return True
    low = f"the IoU of a role is {score.min_role_iou:.3f}, below {min_role_iou:g}"
    click.echo(low, err=True)
    return False


def _score(material: LabMaterial, model: Path | None) -> tuple[PickScore, dict[str, Any]]:
    """Score on picks, print the score, and return it, also as JSON values."""
    classes, uses = material.lab.classes, material.uses()
    picks = [pick for pick in picks_of_lab(material, uses) if uses[pick.image] == "check"]
    segment = network_of_lab(material.lab, model).ids
    file = material.teacher
    trained = MaskSource(file=file, classes=classes) if file.is_file() else None
    teacher = teacher_of_lab(material) or trained
    beside = None
    with progress_bars() as advance:
        score = score_picks(segment, picks, material.frames, classes, advance=advance)
        if teacher is not None:
            try:
                beside = score_picks(teacher.load(), picks, material.frames, classes)
            except WeightsError as error:  # the score of the network does not depend on it
                click.echo(f"teacher: not scored ({error})", err=True)
    click.echo("\n".join(score_lines(score)))
    if beside is not None:
        click.echo(
            f"teacher: {beside.total.accuracy:.3f} of the picks right, IoU of the roles "
            f"{beside.total.role_miou:.3f}"
        )
    sheet = material.training / "check.png"
    write_sheet(score, segment, material.frames, sheet)
    click.echo(f"worst images: {sheet}")
    return score, {**score.to_json(), "teacher": None if beside is None else beside.to_json()}


def score_lines(score: PickScore) -> Iterator[str]:
    """Yield the lines that describe a score on picks."""
    total, counts = score.total, score.picks
    held_out = sum(counts.values())
    yield f"{held_out} held-out picks on {total.images} images: {total.accuracy:.3f} right"
    in_roles = dict(zip(ROLE_NAMES, total.role_counts.sum(axis=1).tolist(), strict=True))
    for what, each, ious in (("role", in_roles, total.role_iou), ("class", counts, total.iou)):
        rows = [(what, "picks", "IoU")]
        for (name, count), iou in zip(each.items(), ious, strict=True):
            rows.append((f"  {name}", str(count), f"{iou:.3f}" if count else "-"))
        yield table(rows)
    for true, taken, share in score.confusions():
        yield f"{true} taken for {taken}: {100 * share:.0f} % of its picks"
    if score.unchecked:
        yield f"unchecked, because without held-out picks: {', '.join(score.unchecked)}"
    wrong = [each for each in score.images if each.wrong][:5]
    if wrong:
        texts = (f"{each.image} ({each.wrong} of {len(each.picks)})" for each in wrong)
        yield f"most wrong picks: {', '.join(texts)}"
