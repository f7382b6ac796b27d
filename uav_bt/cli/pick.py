"""`uav-bt pick`: points of which a person, or the twin in a person's place, says the class."""

from __future__ import annotations

import contextlib
from pathlib import Path

import click

from uav_bt.cli.options import output_option, seed_option, views_option
from uav_bt.cli.progress import progress_bars

__all__ = ["pick"]


@click.group()
def pick() -> None:
    """Make the picks that the teacher learns from."""


@pick.command()
@click.argument("folder", type=click.Path(path_type=Path))
@output_option("--picks", "The CSV file; picks.csv if not given.")
@click.option(
    "--port", type=click.IntRange(0, 65535), default=0, help="Of the page; 0: a free one."
)
def photographs(*, folder: Path, picks: Path | None, port: int) -> None:
    """Click picks on the photographs of FOLDER, on a page in the browser."""
    from perception.segmentation.training.pick_tool import (  # noqa: PLC0415 - late, for --help
        PickSession,
        make_pick_server,
    )

    file = Path("picks.csv") if picks is None else picks
    session = PickSession(folder, file)
    with make_pick_server(session, port=port) as server:
        click.echo(f"open http://127.0.0.1:{server.server_port}/ and click; Ctrl-C when done")
        with contextlib.suppress(KeyboardInterrupt):
            server.serve_forever()
    click.echo(f"{len(session.picks)} picks: {file}")


@pick.command()
@output_option("--picks", "The CSV file; picks.csv if not given.")
@views_option(60)
@seed_option()
@click.option(
    "--total", type=click.IntRange(min=1), default=6500, show_default=True, help="Picks in all."
)
def twin(*, picks: Path | None, scenes: tuple[str, ...], views: int, seed: int, total: int) -> None:
    """Draw picks from the twin's exact class ids, as a person would click them."""
    from perception.segmentation.teacher import TeacherConfig  # noqa: PLC0415
    from perception.segmentation.training.picks import write_picks  # noqa: PLC0415 - late, for --help
    from uav_bt.learning import segmentation as training  # noqa: PLC0415
    from uav_bt.learning.scenes import TRAINING_SCENES  # noqa: PLC0415
    from uav_bt.learning.views import ViewPlan  # noqa: PLC0415

    plan = ViewPlan(scenes=scenes or TRAINING_SCENES, views=views, seed=seed)
    with progress_bars() as advance:
        drawn = training.draw_twin_picks(plan, TeacherConfig(), total=total, advance=advance)
    file = Path("picks.csv") if picks is None else picks
    write_picks(file, drawn)
    click.echo(f"{len(drawn)} simulated picks: {file}")
