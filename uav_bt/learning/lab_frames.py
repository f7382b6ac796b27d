"""Images of a lab from videos, flight records and photographs, for `uav-bt lab frames`."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from perception.camera.image_files import IMAGE_SUFFIXES
from perception.segmentation.training.frame_choice import clear_ones, different_ones
from uav_bt.errors import FileError, InputError
from uav_bt.files import check_output_folder, writing
from uav_bt.lab.lab import Lab
from uav_bt.learning.frame_candidates import Candidate, look_at_photograph, watch
from uav_bt.learning.frame_names import free_stem, image_name, moved
from uav_bt.learning.frame_sources import Filmed, FrameSources, Photograph, find_sources
from uav_bt.learning.frames_summary import (
    FramesSummary,
    SourceSummary,
    summary_of_earlier,
)
from uav_bt.learning.lab_material import LabFrame, LabMaterial, Use
from uav_bt.progress import Advance, silent

DEFAULT_COUNT: Final = 300
FEW: Final = 40
"""Fewer images than this teach a network little."""

_CANDIDATES: Final = ".candidates-"  # folder beside the images while a source is read
_PARTS: Final = 10  # of a video's time
_PARTS_A_CHECK: Final = 5  # every fifth part, and every fifth photograph
_MISSED: Final = 0.9  # a video that ends before this share of its duration was cut short
_PHOTOGRAPHS: Final = "photographs"


def take_frames(
    lab: Lab, paths: Sequence[Path], *, count: int = DEFAULT_COUNT, advance: Advance = silent
) -> FramesSummary:
    """Take images of a lab from videos, flight records and photographs.

    Sources are finished one by one, so that a run that was stopped goes on where it was. A source
    whose images are in the lab's list is not read again.

    Args:
        lab: The lab.
        paths: Files, and folders of them.
        count: Most images of all videos together, shared by their durations; also the most
            photographs.
        advance: Called with the progress.

    Raises:
        InputError: A path is no source, or no source gave an image.
        FileError: The list of images is malformed, or a file cannot be written.
    """
    material = LabMaterial(lab=lab)
    sources = find_sources(paths, material.frames)
    material.read_frames()  # refuses a malformed list before the folder is made
    check_output_folder(material.frames)
    with writing(material.frames):
        material.frames.mkdir(exist_ok=True)
        for left in material.frames.glob(f"{_CANDIDATES}*"):  # by a run that was killed
            shutil.rmtree(left)
    try:
        return _Run(material, sources, count, advance).result()
    finally:
        with suppress(OSError):  # it stays unless it is empty
            material.frames.rmdir()


class _Run:
    """One run over all sources."""

    def __init__(
        self, material: LabMaterial, sources: FrameSources, count: int, advance: Advance
    ) -> None:
        self._material, self._sources, self._count = material, sources, count
        self._advance = advance
        self._listed = material.read_frames()

    def result(self) -> FramesSummary:
        """Take the images of all sources."""
        summaries: list[SourceSummary] = []
        errors: list[FileError] = []
        left, filmed = self._count, self._sources.filmed
        unread = [one for one in filmed if not self._there(one.name)]
        total_s = sum(one.duration_s for one in unread)
        done_s = 0.0
        for place, one in enumerate(filmed):
            share = one.duration_s / max(1e-9, sum(each.duration_s for each in filmed[place:]))
            there = self._there(one.name)
            if there:
                summaries.append(summary_of_earlier(one.name, there))
            else:
                quota = max(1, round(left * min(1.0, share)))
                try:
                    summaries.append(self._film(one, quota, done_s, total_s))
                except FileError as error:
                    errors.append(error)
                done_s += one.duration_s
            left -= summaries[-1].kept if summaries and summaries[-1].source == one.name else 0
        if self._sources.photographs:
            try:
                summaries.extend(self._photographs())
            except FileError as error:
                errors.append(error)
        if errors and not any(one.kept for one in summaries):
            raise errors[0] if len(errors) == 1 else InputError("\n".join(map(str, errors)))
        return FramesSummary(
            folder=self._material.frames,
            sources=tuple(summaries),
            total=len(self._material.uses()),
            notes=self._sources.notes,
            refused=tuple(map(str, errors)),
        )

    def _there(self, source: str) -> list[LabFrame]:
        """Return the listed images of a source that exist."""
        folder = self._material.frames
        return [
            one for one in self._listed if one.source == source and (folder / one.image).is_file()
        ]

    def _film(self, filmed: Filmed, quota: int, done_s: float, total_s: float) -> SourceSummary:
        def on_time(time_s: float) -> None:
            seconds = done_s + min(time_s, filmed.duration_s)
            self._advance(f"seconds of video, {filmed.name}", int(seconds), max(1, int(total_s)))

        with self._candidates() as folder:
            watched = watch(filmed, Path(folder), on_time)
            on_time(filmed.duration_s)
            clear = _clear(watched.candidates, filmed.path)
            order = different_ones([one.look for one in clear])
            if len(order) == 1 and len(clear) > 1:
                raise FileError(
                    filmed.path,
                    f"all its images look alike ({len(clear)} were compared): walk or fly through "
                    "the place while filming",
                )
            chosen = sorted((clear[index] for index in order[:quota]), key=lambda one: one.time_s)
            uses = [use_at(one.time_s, watched.end_s) for one in chosen]
            stem = free_stem(filmed.name, self._others([filmed.name]))
            self._keep(chosen, uses, [image_name(stem, one.time_s) for one in chosen])
        notes = list(filmed.skipped)
        if watched.end_s < _MISSED * filmed.duration_s - 1.0:
            notes.append(
                f"the file ends at {watched.end_s:.1f} s of {filmed.duration_s:.1f} s, so it was "
                "cut short; what could be read is used"
            )
        return SourceSummary(
            source=filmed.name,
            read=watched.read,
            blurred=len(watched.candidates) - len(clear),
            alike=len(clear) - len(order),
            surplus=len(order) - len(chosen),
            kept=len(chosen),
            for_check=uses.count("check"),
            notes=tuple(notes),
        )

    def _photographs(self) -> list[SourceSummary]:
        photographs = self._sources.photographs
        there = [frame for one in photographs for frame in self._there(one.name)]
        unread = [one for one in photographs if not self._there(one.name)]
        summaries = [summary_of_earlier(_PHOTOGRAPHS, there)] if there else []
        if not unread:
            return summaries
        with self._candidates() as folder:
            candidates, notes = self._looked_at(unread, Path(folder))
            clear = [one for one in candidates if one.file is not None]
            order = different_ones([one.look for one in clear])
            wanted = max(0, self._count - len(there))
            chosen = [clear[index] for index in sorted(order[:wanted])]
            earlier = sum(_is_photograph(frame.source) for frame in self._listed)
            uses: list[Use] = [
                "check" if number % _PARTS_A_CHECK == 0 else "train"
                for number in range(earlier + 1, earlier + 1 + len(chosen))
            ]
            if not chosen and not there:
                where = unread[0].path if len(unread) == 1 else unread[0].path.parent
                raise FileError(
                    where, f"no photograph can be used: {'; '.join(notes) or 'all are blank'}"
                )
            if chosen:
                self._keep(chosen, uses, self._photograph_names(chosen))
        summary = SourceSummary(
            source=_PHOTOGRAPHS,
            read=len(unread),
            blurred=len(candidates) - len(clear),
            alike=len(clear) - len(order),
            surplus=len(order) - len(chosen),
            kept=len(chosen),
            for_check=uses.count("check"),
            notes=tuple(notes),
        )
        return [*summaries, summary]

    def _looked_at(
        self, photographs: Sequence[Photograph], folder: Path
    ) -> tuple[list[Candidate], list[str]]:
        candidates, notes = [], []
        for number, one in enumerate(photographs, start=1):
            try:
                candidates.append(look_at_photograph(one, folder / f"{number:05d}.jpg"))
            except FileError as error:
                notes.append(str(error))
            self._advance(f"{_PHOTOGRAPHS}, {one.name}", number, len(photographs))
        return candidates, notes

    def _photograph_names(self, chosen: Sequence[Candidate]) -> list[str]:
        listed = list(self._others([one.source for one in chosen]))
        names = []
        for one in chosen:
            names.append(image_name(free_stem(one.source, listed), None))
            listed.append(
                LabFrame(image=names[-1], source=one.source, time_s=0.0, sharpness=0.0, use="train")
            )
        return names

    def _candidates(self) -> tempfile.TemporaryDirectory[str]:
        # In the lab's folder, because a temporary folder of the system may be in memory.
        with writing(self._material.frames):
            return tempfile.TemporaryDirectory(prefix=_CANDIDATES, dir=self._material.frames)

    def _others(self, sources: Sequence[str]) -> list[LabFrame]:
        return [frame for frame in self._listed if frame.source not in sources]

    def _keep(
        self, chosen: Sequence[Candidate], uses: Sequence[Use], wished: Sequence[str]
    ) -> None:
        """Move chosen images into the lab's folder and write the list."""
        files = [one.file for one in chosen if one.file is not None]
        with moved(list(zip(files, wished, strict=True)), self._material.frames) as names:
            added = [
                LabFrame(
                    image=name,
                    source=one.source,
                    time_s=one.time_s,
                    sharpness=one.look.sharpness,
                    use=use,
                )
                for name, one, use in zip(names, chosen, uses, strict=True)
            ]
            listed = [*self._others([one.source for one in chosen]), *added]
            self._material.write_frames(listed)
        self._listed = listed


def use_at(time_s: float, end_s: float) -> Use:
    """Return the use of a video's image: the fifth and the last tenth of its time are for checks.

    Args:
        time_s: Time of the image.
        end_s: Time of the video's last image.
    """
    part = min(_PARTS - 1, int(_PARTS * time_s / end_s)) if end_s > 0.0 else 0
    return "check" if part % _PARTS_A_CHECK == _PARTS_A_CHECK - 1 else "train"


def _clear(candidates: Sequence[Candidate], path: Path) -> list[Candidate]:
    """Return the candidates that are neither blank nor blurred.

    Raises:
        FileError: All candidates are blank or blurred.
    """
    looks = [one.look for one in candidates]
    clear = [one for one, good in zip(candidates, clear_ones(looks), strict=True) if good]
    if not clear:
        blank = sum(look.blank for look in looks)
        raise FileError(
            path,
            f"none of its images can be used: {blank} are dark or of one colour, "
            f"{len(looks) - blank} are blurred; film slowly, in good light, with a clean lens",
        )
    return clear


def _is_photograph(source: str) -> bool:
    return Path(source).suffix.lower() in IMAGE_SUFFIXES
