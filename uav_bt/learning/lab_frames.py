"""Images of a lab from videos, flight records and photographs, for `uav-bt lab frames`."""

from __future__ import annotations

import re
import shutil
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from perception.segmentation.training.frame_choice import different_ones
from uav_bt.errors import FileError, InputError
from uav_bt.files import check_output_folder, writing
from uav_bt.lab.lab import Lab
from uav_bt.learning import frame_sources
from uav_bt.learning.frame_sources import Candidate, FrameSource, is_photograph
from uav_bt.learning.lab_material import LabFrame, LabMaterial, Use, nth_use
from uav_bt.protocols import Advance, silent

DEFAULT_COUNT: Final = 300
FEW: Final = 40
"""Fewer images than this teach a network little."""

# Folder of a source that is being read; the system's temporary one may be in memory.
_CANDIDATES: Final = ".candidates-"
_PARTS: Final = 10  # of a video's time
_PHOTOGRAPHS: Final = "photographs"
_LONGEST_NAME: Final = 60  # characters


@dataclass(frozen=True, kw_only=True)
class SourceSummary:
    """Images of one source."""

    source: str  # name of the video, or "photographs" for all of them
    read: int = 0  # images that were read
    blurred: int = 0  # images of the best in each half second that were blurred or blank
    alike: int = 0  # those that were nearly the same as a kept one
    surplus: int = 0  # those beyond the number that was asked for
    kept: int = 0  # those that were kept
    for_check: int = 0  # those of the kept ones that only score the network
    notes: tuple[str, ...] = ()  # remarks
    earlier: bool = False  # whether the images were taken in an earlier run


@dataclass(frozen=True, kw_only=True)
class FramesSummary:
    """Result of a run."""

    folder: Path  # where the images are
    sources: tuple[SourceSummary, ...]  # one entry for each source
    total: int  # images of the lab, also from earlier runs
    notes: tuple[str, ...]  # lines about files that are not read
    refused: tuple[str, ...]  # errors of sources that gave no images


def take_frames(
    lab: Lab, paths: Sequence[Path], *, count: int = DEFAULT_COUNT, advance: Advance = silent
) -> FramesSummary:
    """Take images of a lab from videos, flight records and photographs, and folders of them.

    Sources are finished one by one; one whose images are in the lab's list is not read again.
    `count` limits the images of all videos together, shared by their durations, and also the
    photographs.
    """
    material = LabMaterial(lab=lab)
    run = _Run(material, advance)  # refuses a malformed list before the folder is made
    filmed, photographs, notes = frame_sources.find_sources(paths, material.frames)
    check_output_folder(material.frames)
    with writing(material.frames):
        material.frames.mkdir(exist_ok=True)
        for old in material.frames.glob(f"{_CANDIDATES}*"):  # by a run that was killed
            shutil.rmtree(old)
    left = count
    try:
        for place, one in enumerate(filmed):
            share = one.seconds / sum(each.seconds for each in filmed[place:])
            left -= run.take([one], max(1, round(left * share)))
        if photographs:
            run.take(photographs, count)
        errors = run.errors
        if errors and not any(one.kept for one in run.summaries):
            raise errors[0] if len(errors) == 1 else InputError("\n".join(map(str, errors)))
        total = len(material.uses())
    finally:
        with suppress(OSError):  # it stays unless it is empty
            material.frames.rmdir()
    return FramesSummary(
        folder=material.frames,
        sources=tuple(run.summaries),
        total=total,
        notes=tuple(notes),
        refused=tuple(map(str, errors)),
    )


class _Run:
    """One run over all sources."""

    def __init__(self, material: LabMaterial, advance: Advance) -> None:
        self._material = material
        self._listed = material.read_frames()
        self._advance = advance
        self.summaries: list[SourceSummary] = []
        self.errors: list[FileError] = []

    def take(self, sources: Sequence[FrameSource], most: int) -> int:
        """Take images of a video or of photographs, unless they are there; return their number."""
        folder, contents = self._material.frames, {one.content for one in sources}
        there = [
            frame
            for frame in self._listed
            if frame.content in contents and (folder / frame.image).is_file()
        ]
        if there:
            self._sum_up(sources, there, earlier=True)
        taken = {frame.content for frame in there}
        unread = [one for one in sources if one.content not in taken]
        if not unread:
            return len(there)
        with TemporaryDirectory(prefix=_CANDIDATES, dir=folder) as scratch:
            try:
                return self._choose(unread, Path(scratch), max(0, most - len(there)))
            except FileError as error:
                self.errors.append(error)
                return 0

    def _choose(self, sources: Sequence[FrameSource], scratch: Path, most: int) -> int:
        """Add the most different of the clear images to the lab; return their number."""
        clear, blurred, times_s, notes = frame_sources.watch(sources, scratch, self._advance)
        order = different_ones([one.look for one in clear])
        if len(sources) == 1 and len(order) == 1 < len(clear):
            raise FileError(
                sources[0].path,
                f"all its images look alike ({len(clear)} were compared): walk or fly through the "
                "place while filming",
            )
        stills = sum(is_photograph(Path(frame.source)) for frame in self._listed)
        added = [
            self._keep(clear[index], number, times_s[-1])
            for number, index in enumerate(sorted(order[:most]), start=stills + 1)
        ]
        renewed = {frame.content for frame in added}
        others = [frame for frame in self._listed if frame.content not in renewed]
        self._listed = [*others, *added]
        self._material.write_frames(self._listed)
        self._sum_up(
            sources,
            added,
            read=len(times_s),
            blurred=blurred,
            alike=len(clear) - len(order),
            surplus=len(order) - len(added),
            notes=tuple(notes),
        )
        return len(added)

    def _keep(self, one: Candidate, number: int, end_s: float) -> LabFrame:
        """Move a candidate into the lab's folder, unless a killed run left it there.

        `number` counts the lab's photographs, and `end_s` is the time of a video's last image.
        """
        source = one.source
        stem = re.sub(r"[^\w.-]+", "-", Path(source.path.name).stem).strip(".-")[:_LONGEST_NAME]
        # The hash, because cameras repeat names on each memory card.
        name = f"{stem or 'video'}-{source.content[:6]}"
        use = nth_use(number)
        if not is_photograph(source.path):
            name, use = f"{name}-{one.time_s:07.1f}", use_at(one.time_s, end_s)
        file = self._material.frames / f"{name}.jpg"
        if not file.exists():
            with writing(file):
                one.file.rename(file)
        return LabFrame(
            image=file.name,
            source=source.path.name,
            time_s=one.time_s,
            sharpness=one.look.sharpness,
            use=use,
            content=source.content,
        )

    def _sum_up(
        self, sources: Sequence[FrameSource], frames: Sequence[LabFrame], **about: Any
    ) -> None:
        path, checks = sources[0].path, sum(frame.use == "check" for frame in frames)
        name = _PHOTOGRAPHS if is_photograph(path) else path.name
        self.summaries.append(
            SourceSummary(source=name, kept=len(frames), for_check=checks, **about)
        )


def use_at(time_s: float, end_s: float) -> Use:
    """Return the use of a video's image: the fifth and the last tenth are for checks.

    `end_s` is the time of the video's last image.
    """
    part = min(_PARTS - 1, int(_PARTS * time_s / end_s)) if end_s > 0.0 else 0
    return nth_use(part + 1)
