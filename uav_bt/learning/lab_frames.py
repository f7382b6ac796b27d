"""Images of a lab from videos, flight records and photographs, for `uav-bt lab frames`."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from perception.segmentation.training.frame_choice import different_ones
from uav_bt.errors import FileError, InputError
from uav_bt.files import check_output_folder, writing
from uav_bt.lab.lab import Lab
from uav_bt.learning import frame_sources
from uav_bt.learning.frame_sources import Candidate, FrameSource, is_photograph
from uav_bt.learning.lab_material import LabFrame, LabMaterial, Use, nth_use
from uav_bt.progress import Advance, silent

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
    left, errors = count, run.errors
    try:
        for place, one in enumerate(filmed):
            share = one.seconds / max(1e-9, sum(each.seconds for each in filmed[place:]))
            try:
                left -= run.film(one, max(1, round(left * min(1.0, share))))
            except FileError as error:
                errors.append(error)
        run.photograph(photographs, count)
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

    def film(self, filmed: FrameSource, quota: int) -> int:
        """Take images of a video, unless they are there; return their number."""
        if there := self._there([filmed], filmed.path.name):
            return len(there)

        with TemporaryDirectory(prefix=_CANDIDATES, dir=self._material.frames) as folder:
            candidates, read, end_s = frame_sources.watch(filmed, Path(folder), self._advance)
            clear = frame_sources.clear_candidates(candidates, filmed.path)
            summary = SourceSummary(
                source=filmed.path.name,
                read=read,
                blurred=len(candidates) - len(clear),
                notes=(*filmed.images.warnings, *filmed.images.skipped),
            )
            return self._keep(summary, clear, quota, lambda one, _: use_at(one.time_s, end_s))

    def photograph(self, photographs: Sequence[FrameSource], count: int) -> None:
        """Take the photographs that are not there."""
        there = self._there(photographs, _PHOTOGRAPHS)
        taken = {frame.content for frame in there}
        unread = [one for one in photographs if one.content not in taken]
        if not unread:
            return
        with TemporaryDirectory(prefix=_CANDIDATES, dir=self._material.frames) as folder:
            candidates: list[Candidate] = []
            notes = []
            for number, one in enumerate(unread, start=1):
                try:
                    candidates += frame_sources.watch(one, Path(folder), silent)[0]
                except FileError as error:
                    notes.append(str(error))
                self._advance(f"{_PHOTOGRAPHS}, {one.path.name}", number, len(unread))
            clear = [one for one in candidates if not one.look.blank]
            if not clear and not there:
                where = unread[0].path if len(unread) == 1 else unread[0].path.parent
                what = f"no photograph can be used: {'; '.join(notes) or 'all are blank'}"
                self.errors.append(FileError(where, what))
                return
            earlier = sum(is_photograph(Path(frame.source)) for frame in self._listed)
            summary = SourceSummary(
                source=_PHOTOGRAPHS,
                read=len(unread),
                blurred=len(candidates) - len(clear),
                notes=tuple(notes),
            )
            most = max(0, count - len(there))
            self._keep(summary, clear, most, lambda _, number: nth_use(earlier + number))

    def _there(self, sources: Sequence[FrameSource], name: str) -> list[LabFrame]:
        """Return the images of sources that an earlier run took, and add their summary."""
        contents = {one.content for one in sources}
        folder = self._material.frames
        there = [
            frame
            for frame in self._listed
            if frame.content in contents and (folder / frame.image).is_file()
        ]
        if there:
            checks = sum(frame.use == "check" for frame in there)
            summary = SourceSummary(source=name, kept=len(there), for_check=checks, earlier=True)
            self.summaries.append(summary)
        return there

    def _keep(
        self,
        summary: SourceSummary,
        clear: Sequence[Candidate],
        most: int,
        use_of: Callable[[Candidate, int], Use],
    ) -> int:
        """Move the most different candidates into the lab's folder, and then write the list.

        A file that is there already stays: a run that was killed left it. `use_of` takes a
        candidate and its number, from 1.
        """
        order = different_ones([one.look for one in clear])
        if len(order) == 1 < len(clear) and clear[0].source is clear[1].source:
            raise FileError(
                clear[0].source.path,
                f"all its images look alike ({len(clear)} were compared): walk or fly through the "
                "place while filming",
            )
        added = []
        for number, index in enumerate(sorted(order[:most]), start=1):
            one, source = clear[index], clear[index].source
            stem = re.sub(r"[^\w.-]+", "-", Path(source.path.name).stem).strip(".-")[:_LONGEST_NAME]
            # The hash, because cameras repeat names on each memory card.
            name = f"{stem or 'video'}-{source.content[:6]}"
            if not is_photograph(source.path):
                name = f"{name}-{one.time_s:07.1f}"
            file = self._material.frames / f"{name}.jpg"
            if not file.exists():
                with writing(file):
                    one.file.rename(file)
            added.append(
                LabFrame(
                    image=file.name,
                    source=source.path.name,
                    time_s=one.time_s,
                    sharpness=one.look.sharpness,
                    use=use_of(one, number),
                    content=source.content,
                )
            )
        sources = {frame.content for frame in added}
        others = [frame for frame in self._listed if frame.content not in sources]
        self._listed = [*others, *added]
        self._material.write_frames(self._listed)
        self.summaries.append(
            replace(
                summary,
                alike=len(clear) - len(order),
                surplus=len(order) - len(added),
                kept=len(added),
                for_check=sum(frame.use == "check" for frame in added),
            )
        )
        return len(added)


def use_at(time_s: float, end_s: float) -> Use:
    """Return the use of a video's image: the fifth and the last tenth are for checks.

    `end_s` is the time of the video's last image.
    """
    part = min(_PARTS - 1, int(_PARTS * time_s / end_s)) if end_s > 0.0 else 0
    return nth_use(part + 1)
