"""Progress of long work, on the standard error stream."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

__all__ = ["progress_bars"]


@contextmanager
def progress_bars() -> Iterator[Callable[[str, int, int], None]]:
    """Show one bar for each stage of the work inside.

    Yields:
        What to call with a stage's text, the steps done and the steps in all. The text up to its
        first comma is the stage's name; the rest may change from call to call.
    """
    from rich.console import Console  # noqa: PLC0415 - `--help` need not wait for it
    from rich.progress import (  # noqa: PLC0415
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TaskID,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    stages: dict[str, TaskID] = {}
    with Progress(*columns, console=Console(stderr=True)) as bars:

        def advance(stage: str, done: int, total: int) -> None:
            name = stage.partition(",")[0]
            if name not in stages:
                stages[name] = bars.add_task(stage)
            bars.update(stages[name], description=stage, completed=done, total=total)

        yield advance
