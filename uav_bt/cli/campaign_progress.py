"""How a campaign goes, on the standard error stream: a bar on a terminal, a line a flight else."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

__all__ = ["CampaignProgress", "campaign_progress"]


class CampaignProgress:
    """Counts flights and shows them; made by `campaign_progress`."""

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
        """Count a flight.

        Args:
            flight: its line.
            now: whether it was flown just now, not in an earlier run.
        """
        self._outcomes[flight["outcome"]] += 1
        told = "  ".join(f"{name} {count}" for name, count in sorted(self._outcomes.items()))
        if now:
            self._bar.update(self._task, advance=1, description=told)
        else:
            # What was there before took no time now: it must not make the rest look quick.
            self._bar.reset(self._task, completed=self.done, description=told)
        if flight["outcome"] != "success" or (now and not self._bar.console.is_terminal):
            self.note(
                f"{self.done}/{self._total} {flight['tree']} {flight['scene']} seed "
                f"{flight['seed']}: {flight['outcome']}, {flight.get('reason', '')}"
            )

    def note(self, text: str) -> None:
        """Say something in a line above the bar."""
        self._bar.console.print(Text(text), soft_wrap=True)


@contextmanager
def campaign_progress(total: int, console: Console | None = None) -> Iterator[CampaignProgress]:
    """Show a campaign of so many flights while it is flown inside.

    Args:
        total: flights that the plan asks for.
        console: where to write; default: the standard error stream.
    """
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
