"""Images of a lab from videos, flight records and photographs, for `uav-bt lab frames`."""

from __future__ import annotations

import filecmp
import re
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from perception.segmentation.training.frame_choice import different_ones
from uav_bt.errors import FileError, InputError
from uav_bt.files import check_output_folder, writing
from uav_bt.lab.lab import Lab
from uav_bt.learning.frame_sources import (
    Candidate,
    FrameSource,
    clear_candidates,
    find_sources,
    is_photograph,
    watch,
)
from uav_bt.learning.lab_material import LabFrame, LabMaterial, Use
from uav_bt.progress import Advance, silent

DEFAULT_COUNT: Final = 300
FEW: Final = 40
"""Fewer images than this teach a network little."""

_CANDIDATES: Final = ".candidates-"  # folder beside the images while a source is read
_PARTS: Final = 10  # of a video's time
_PARTS_A_CHECK: Final = 5  # every fifth part, and every fifth photograph
_MISSED: Final = 0.9  # a video that ends before this share of its stated duration was cut short
_PHOTOGRAPHS: Final = "photographs"
_LONGEST_NAME: Final = 60  # characters
_TIME: Final = re.compile(r"-\d{5,}\.\d(-\d+)?$")  # at the end of an image's name


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

    Sources are finished one by one, so that a run that was stopped goes on where it was. A source
    whose images are in the lab's list is not read again. `count` limits the images of all videos
    together, shared by their durations, and also the photographs.
    """
    material = LabMaterial(lab=lab)
    listed = material.read_frames()  # refuses a malformed list before the folder is made
    filmed, photographs, notes = find_sources(paths, material.frames, listed)
    check_output_folder(material.frames)
    with writing(material.frames):
        material.frames.mkdir(exist_ok=True)
        for old in material.frames.glob(f"{_CANDIDATES}*"):  # by a run that was killed
            shutil.rmtree(old)
    run = _Run(material, listed, count, advance)
    errors: list[FileError] = []
    try:
        done_s, left = 0.0, count
        total_s = sum(one.seconds for one in filmed if not run.there(one))
        for place, one in enumerate(filmed):
            there = run.there(one)
            if there:
                left -= run.add_earlier(one.name, there)
                continue
            share = one.seconds / max(1e-9, sum(each.seconds for each in filmed[place:]))
            try:
                left -= run.film(one, max(1, round(left * min(1.0, share))), done_s, total_s)
            except FileError as error:
                errors.append(error)
            done_s += one.seconds
        if photographs:
            try:
                run.photograph(photographs)
            except FileError as error:
                errors.append(error)
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

    def __init__(
        self, material: LabMaterial, listed: list[LabFrame], count: int, advance: Advance
    ) -> None:
        self._material = material
        self._listed = listed
        self._count = count
        self._advance = advance
        self.summaries: list[SourceSummary] = []

    def there(self, source: FrameSource) -> list[LabFrame]:
        """Return the listed images of a source that exist."""
        folder = self._material.frames
        return [one for one in self._listed if source.gave(one) and (folder / one.image).is_file()]

    def add_earlier(self, name: str, there: Sequence[LabFrame]) -> int:
        """Add the summary of a source whose images are there already; return their number."""
        checks = sum(frame.use == "check" for frame in there)
        self.summaries.append(
            SourceSummary(source=name, kept=len(there), for_check=checks, earlier=True)
        )
        return len(there)

    def film(self, filmed: FrameSource, quota: int, done_s: float, total_s: float) -> int:
        """Take images of a video; return their number."""

        def on_time(time_s: float) -> None:
            seconds = done_s + min(time_s, filmed.seconds)
            self._advance(f"seconds of video, {filmed.name}", int(seconds), max(1, int(total_s)))

        with self._candidates() as folder:
            candidates, read, end_s = watch(filmed, Path(folder), on_time)
            on_time(filmed.seconds)
            clear = clear_candidates(candidates, filmed.path)
            chosen, different = _most_different(clear, quota)
            if different == 1 and len(clear) > 1:
                raise FileError(
                    filmed.path,
                    f"all its images look alike ({len(clear)} were compared): walk or fly through "
                    "the place while filming",
                )
            stem = self._free_stem(filmed, [])
            uses = [use_at(one.time_s, end_s) for one in chosen]
            self._keep(chosen, uses, [f"{stem}-{one.time_s:07.1f}.jpg" for one in chosen])
        stated_s = filmed.images.duration_s
        notes = [*filmed.images.warnings, *filmed.images.skipped]
        if stated_s is not None and end_s < _MISSED * stated_s - 1.0:
            notes.append(
                f"the file ends at {end_s:.1f} s of {stated_s:.1f} s, so it was cut short; what "
                "could be read is used"
            )
        counts = (read, len(candidates), len(clear), different)
        self._summarise(filmed.name, counts, uses, notes)
        return len(chosen)

    def photograph(self, photographs: Sequence[FrameSource]) -> None:
        """Take photographs."""
        there = [frame for one in photographs for frame in self.there(one)]
        unread = [one for one in photographs if not self.there(one)]
        if there:
            self.add_earlier(_PHOTOGRAPHS, there)
        if not unread:
            return
        with self._candidates() as folder:
            candidates, notes = [], []
            for number, one in enumerate(unread, start=1):
                place = Path(folder) / str(number)
                place.mkdir()
                try:
                    candidates += watch(one, place, lambda _: None)[0]
                except FileError as error:
                    notes.append(str(error))
                self._advance(f"{_PHOTOGRAPHS}, {one.name}", number, len(unread))
            clear = [one for one in candidates if one.file is not None]
            chosen, different = _most_different(clear, max(0, self._count - len(there)))
            if not chosen and not there:
                where = unread[0].path if len(unread) == 1 else unread[0].path.parent
                raise FileError(
                    where, f"no photograph can be used: {'; '.join(notes) or 'all are blank'}"
                )
            earlier = sum(is_photograph(Path(frame.source)) for frame in self._listed) + 1
            uses = [_nth_use(earlier + place) for place in range(len(chosen))]
            names: list[str] = []
            for each in chosen:
                names.append(f"{self._free_stem(each.source, names)}.jpg")
            if chosen:
                self._keep(chosen, uses, names)
        counts = (len(unread), len(candidates), len(clear), different)
        self._summarise(_PHOTOGRAPHS, counts, uses, notes)

    def _summarise(
        self,
        name: str,
        counts: tuple[int, int, int, int],
        uses: Sequence[Use],
        notes: Sequence[str],
    ) -> None:
        read, candidates, clear, different = counts
        self.summaries.append(
            SourceSummary(
                source=name,
                read=read,
                blurred=candidates - clear,
                alike=clear - different,
                surplus=different - len(uses),
                kept=len(uses),
                for_check=uses.count("check"),
                notes=tuple(notes),
            )
        )

    def _candidates(self) -> tempfile.TemporaryDirectory[str]:
        # In the lab's folder, because a temporary folder of the system may be in memory.
        with writing(self._material.frames):
            return tempfile.TemporaryDirectory(prefix=_CANDIDATES, dir=self._material.frames)

    def _free_stem(self, source: FrameSource, others: Sequence[str]) -> str:
        """Return the beginning of the image names of a source, which no other source has."""
        suffix = Path(source.name).suffix
        cleaned = re.sub(r"[^\w.-]+", "-", source.name.removesuffix(suffix)).strip(".-")
        images = [*others, *(one.image for one in self._listed if not source.gave(one))]
        taken = {_TIME.sub("", Path(image).stem).casefold() for image in images}
        return _first_free(cleaned[:_LONGEST_NAME] or "video", "", taken)

    def _keep(
        self, chosen: Sequence[Candidate], uses: Sequence[Use], wished: Sequence[str]
    ) -> None:
        """Move chosen images into the lab's folder and write the list."""
        files = [one.file for one in chosen if one.file is not None]
        with _moved(list(zip(files, wished, strict=True)), self._material.frames) as names:
            added = [
                LabFrame(
                    image=name,
                    source=one.source.name,
                    time_s=one.time_s,
                    sharpness=one.look.sharpness,
                    use=use,
                    content=one.source.content,
                )
                for name, one, use in zip(names, chosen, uses, strict=True)
            ]
            sources = {one.source.content: one.source for one in chosen}.values()
            others = [row for row in self._listed if not any(one.gave(row) for one in sources)]
            self._material.write_frames([*others, *added])
        self._listed = [*others, *added]


def _most_different(clear: Sequence[Candidate], most: int) -> tuple[list[Candidate], int]:
    """Return the most different candidates in their order, and how many are different at all."""
    order = different_ones([one.look for one in clear])
    return [clear[index] for index in sorted(order[:most])], len(order)


def use_at(time_s: float, end_s: float) -> Use:
    """Return the use of a video's image: the fifth and the last tenth of its time are for checks.

    `end_s` is the time of the video's last image.
    """
    part = min(_PARTS - 1, int(_PARTS * time_s / end_s)) if end_s > 0.0 else 0
    return _nth_use(part + 1)


def _nth_use(number: int) -> Use:
    return "check" if number % _PARTS_A_CHECK == 0 else "train"


# --- files ----------------------------------------------------------------------------------------


@contextmanager
def _moved(files: Sequence[tuple[Path, str]], folder: Path) -> Iterator[list[str]]:
    """Move files with wished names into a folder; remove them again if the block inside fails.

    A file that exists there stays. If its content is the same, as after a run that was killed, it
    is used; otherwise the new file gets a number. Yields the names that they have.
    """
    taken = {path.name.casefold() for path in folder.iterdir()}
    names: list[str] = []
    mine: list[Path] = []
    try:
        for file, wished in files:
            name, there = wished, folder / wished
            same = there.is_file() and filecmp.cmp(file, there, shallow=False)
            if name in names or not same:
                name = _first_free(Path(wished).stem, ".jpg", taken)
                mine.append(folder / name)
                with writing(folder / name):
                    file.rename(folder / name)
            names.append(name)
            taken.add(name.casefold())
        yield names
    except BaseException:
        for path in mine:
            path.unlink(missing_ok=True)
        raise


def _first_free(stem: str, suffix: str, taken: set[str]) -> str:
    # Some file systems do not distinguish capitals.
    name, number = f"{stem}{suffix}", 1
    while name.casefold() in taken:
        number += 1
        name = f"{stem}-{number}{suffix}"
    return name
