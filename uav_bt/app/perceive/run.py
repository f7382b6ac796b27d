"""Perceive every image of a source."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

from uav_bt.app.perceive.inputs import Look, PerceiveOptions
from uav_bt.app.perceive.outputs import Film, PerceiveSummary, Tally, as_json
from uav_bt.app.perceive.pipeline import Perceived
from uav_bt.app.perceive.streams import TimedImage
from uav_bt.errors import InputError
from uav_bt.files import writing
from uav_bt.protocols import Advance, silent

_Write = Callable[[TimedImage, Perceived], None]


def perceive(
    source: str,
    options: PerceiveOptions | None = None,
    *,
    out: Path | None = None,
    lines: Path | None = None,
    advance: Advance = silent,
) -> PerceiveSummary:
    """Perceive every image of a source; Ctrl-C ends it and keeps what was written.

    Args:
        source: a video file, a folder of images, an image, `camera:N`, or a flight record.
        options: what is known about the images.
        out: an mp4 file with the overlays.
        lines: a file with one JSON object for each frame.
        advance: called with the progress.

    Raises:
        InputError: source, camera, telemetry or network cannot be used, or nothing is readable.
        FileError: a file cannot be written.
    """
    options = options or PerceiveOptions()
    read = [Path(source), options.telemetry, options.camera]
    _keep_apart([path for path in (out, lines) if path is not None], read)
    look = Look(source, options)
    pipeline, images = look.begin()
    tally = Tally()
    with ExitStack() as stack:
        stack.enter_context(closing(images))
        writers: list[_Write] = []
        if out is not None:
            film = Film(out, pipeline.camera, look.source.rate_per_s / options.every)
            stack.callback(film.close)
            writers.append(lambda _, seen: film.write(seen))
        if lines is not None:
            writers.append(stack.enter_context(_json_lines(lines)))
        try:
            for image in images:
                frame = look.telemetry.frame(image.image, image.index, image.time_s)
                seen = pipeline.perceive(frame, look.telemetry.states(image.time_s))
                tally.add(seen)
                for write in writers:
                    write(image, seen)
                advance(f"frames, {image.name}", *look.progress(image))
        except KeyboardInterrupt:
            tally.interrupted = True
    return tally.summary(
        camera=look.camera_words, telemetry=look.telemetry_words, skipped=look.source.skipped
    )


def _keep_apart(written: list[Path], read: list[Path | None]) -> None:
    for path in written:
        for other in read:
            if other is not None and other.exists() and path.exists() and path.samefile(other):
                raise InputError(f"{path} would be written over what is read; name another file")


@contextmanager
def _json_lines(path: Path) -> Iterator[_Write]:
    with writing(path), path.open("w", encoding="utf-8") as file:

        def write(image: TimedImage, seen: Perceived) -> None:
            file.write(json.dumps(as_json(image, seen), allow_nan=False) + "\n")

        yield write
