"""Progress of long work, on the standard error stream."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from uav_bt.errors import MissingDependencyError

__all__ = ["need", "progress_bars"]


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


def need(extra: str, *modules: str) -> None:
    """Refuse to begin work that needs a package which is not installed.

    Raises:
        MissingDependencyError: one is absent; the message names the extra that brings it.
    """
    absent = [module for module in modules if importlib.util.find_spec(module) is None]
    if absent:
        raise MissingDependencyError(
            f"this needs {' and '.join(absent)}; install with `pip install 'uav-bt[{extra}]'`"
        )
