"""Results of taking images of a lab: counts by source."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from uav_bt.learning.lab_material import LabFrame


@dataclass(frozen=True, kw_only=True)
class SourceSummary:
    """Images of one source.

    Attributes:
        source: Name of the video, or "photographs" for all of them.
        read: Images that were read.
        blurred: Images of the best in each half second that were blurred or blank.
        alike: Those that were nearly the same as a kept one.
        surplus: Those beyond the number that was asked for.
        kept: Those that were kept.
        for_check: Those of the kept ones that only score the network.
        notes: Remarks.
        earlier: Whether the images were taken in an earlier run.
    """

    source: str
    read: int = 0
    blurred: int = 0
    alike: int = 0
    surplus: int = 0
    kept: int = 0
    for_check: int = 0
    notes: tuple[str, ...] = ()
    earlier: bool = False


@dataclass(frozen=True, kw_only=True)
class FramesSummary:
    """Result of a run.

    Attributes:
        folder: Where the images are.
        sources: One entry for each source.
        total: Images of the lab, also from earlier runs.
        notes: Lines about files that are not read.
        refused: Errors of sources that gave no images.
    """

    folder: Path
    sources: tuple[SourceSummary, ...]
    total: int
    notes: tuple[str, ...]
    refused: tuple[str, ...]


def summary_of_earlier(name: str, there: Sequence[LabFrame]) -> SourceSummary:
    """Return the summary of a source whose images are there already."""
    return SourceSummary(
        source=name,
        kept=len(there),
        for_check=sum(frame.use == "check" for frame in there),
        earlier=True,
    )
