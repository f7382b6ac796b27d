"""Progress of long work, on the standard error stream."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text


@contextmanager
def progress_bars() -> Iterator[Callable[[str, int, int], None]]:
    """Show one bar for each stage of the work inside.

    Yields:
        A callback for a stage's text, the steps done and the steps in all. The text up to its first
        comma is the stage's name; the rest may change from call to call.
    """
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


class CampaignProgress:
    """Counts flights and shows them: a bar on a terminal, a line per flight elsewhere."""

    def __init__(self, bar: Progress, total: int) -> None:
        self._bar = bar
        self._total = total
        self._task = bar.add_task("", total=total)
        self._outcomes: Counter[str] = Counter()

    @property
    def done(self) -> int:
        """How many flights are kept."""
        return self._outcomes.total()

    def add(self, flight: Mapping[str, Any], now: bool) -> None:  # noqa: FBT001 - a callback's shape
        """Count a flight, by its line; `now`: flown just now, not in an earlier run."""
        self._outcomes[flight["outcome"]] += 1
        counts = "  ".join(f"{name} {count}" for name, count in sorted(self._outcomes.items()))
        if now:
            self._bar.update(self._task, advance=1, description=counts)
        else:
            # Earlier flights took no time now: they must not shorten the estimate for the rest.
            self._bar.reset(self._task, completed=self.done, description=counts)
        if flight["outcome"] != "success" or (now and not self._bar.console.is_terminal):
            self.note(
                f"{self.done}/{self._total} {flight['tree']} {flight['scene']} seed "
                f"{flight['seed']}: {flight['outcome']}, {flight.get('reason', '')}"
            )

    def note(self, text: str) -> None:
        """Print a line above the bar."""
        self._bar.console.print(Text(text), soft_wrap=True)


@contextmanager
def campaign_progress(total: int, console: Console | None = None) -> Iterator[CampaignProgress]:
    """Show a campaign of so many flights while it is flown inside, by default on stderr."""
    console = console or Console(stderr=True)
    columns = (
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.description}", markup=False),
        TimeElapsedColumn(),
        TextColumn("left:"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        yield CampaignProgress(bar, total)
