"""Progress of long work, on the standard error stream."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TaskID, TimeElapsedColumn
from rich.text import Text

from uav_bt.errors import MissionError


@contextmanager
def progress_bars() -> Iterator[Callable[[str, int, int], None]]:
    """Show one bar for each stage of the work inside.

    Yields:
        A callback for a stage's text, the steps done and the steps in all. The text up to its first
        comma is the stage's name; the rest may change from call to call.
    """
    stages: dict[str, TaskID] = {}
    with Progress(console=Console(stderr=True)) as bars:

        def advance(stage: str, done: int, total: int) -> None:
            name = stage.partition(",")[0]
            if name not in stages:
                stages[name] = bars.add_task(stage)
            bars.update(stages[name], description=stage, completed=done, total=total)

        yield advance


class CampaignProgress(Progress):
    """Counts flights and shows them: a bar on a terminal, a line per flight elsewhere."""

    def __init__(self, total: int, console: Console) -> None:
        columns = (*self.get_default_columns(), MofNCompleteColumn(), TimeElapsedColumn())
        super().__init__(*columns, console=console, disable=not console.is_terminal)
        self._task = self.add_task("", total=total)
        self.outcomes: Counter[str] = Counter()

    def add(self, flight: Mapping[str, Any], now: bool) -> None:  # noqa: FBT001 - a callback's shape
        """Count a flight, by its line; `now`: flown just now, not in an earlier run."""
        self.outcomes[flight["outcome"]] += 1
        done = self.outcomes.total()
        counts = "  ".join(f"{name} {count}" for name, count in sorted(self.outcomes.items()))
        self.update(self._task, completed=done, description=counts)
        if not now:
            # Earlier flights took no time now: they must not shorten the estimate for the rest.
            self.reset(self._task, completed=done)
        if flight["outcome"] != "success" or (now and not self.console.is_terminal):
            self.note(
                f"{done}/{self.tasks[0].total} {flight['tree']} {flight['scene']} seed "
                f"{flight['seed']}: {flight['outcome']}, {flight.get('reason', '')}"
            )

    def note(self, text: str) -> None:
        """Print a line above the bar."""
        self.console.print(Text(text), soft_wrap=True)


@contextmanager
def campaign_progress(
    total: int, folder: Path, console: Console | None = None
) -> Iterator[CampaignProgress]:
    """Show a campaign of so many flights while it is flown inside, by default on stderr.

    Ctrl-C ends the process; a line says how many flights are kept in the folder.
    """
    with CampaignProgress(total, console or Console(stderr=True)) as progress:
        try:
            yield progress
        except KeyboardInterrupt as stop:
            progress.note(
                f"stopped; {progress.outcomes.total()} of {total} flights are kept in {folder}, "
                "and the same command continues from there"
            )
            raise SystemExit(MissionError.exit_code) from stop
