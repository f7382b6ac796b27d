"""Training data from flight records: frames, depth labels, advised views."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.control.ego_state import ControlNetConfig
from perception.control.runtime import ControlEstimate, OnnxControlStudent
from perception.control.training.samples import (
    Batch,
    ControlFlight,
    ControlSamples,
    ControlScore,
    advised_flight,
    read_flight,
    score_control,
    write_flight,
)
from perception.depth.training.footage import Flight, gathered, shrink
from perception.depth.training.labelling import (
    add_parallax,
    contact_labels,
    read_labels,
    write_labels,
)
from perception.networks.onnx_runtime import shrunk
from uav_bt.errors import FileError, InputError
from uav_bt.learning.lab_material import fingerprint
from uav_bt.progress import Advance, silent
from uav_bt.protocols import Advice, Segmenter
from uav_bt.record.moment import StoredFrame
from uav_bt.record.reader import RecordReader, flight_record, footage
from uav_bt.types import CameraModel, DroneState
from uav_bt.types.arrays import Image

_FOOTAGE_EVERY_S: Final = 0.1  # one tick
# The rule's reason without depth, which depends on the depth network and not on the view.
_BLIND: Final = "no depth"


# --- files ----------------------------------------------------------------------------------------


def records_of(paths: Sequence[Path]) -> list[Path]:
    """Return the records at paths: files, and all files below folders, without duplicates."""
    found: dict[Path, None] = {}
    for path in paths:
        records = sorted(path.rglob("*.mcap")) if path.is_dir() else [path]
        if not records:
            raise FileError(path, "there is no flight record in this folder")
        found |= dict.fromkeys(records)
    return list(found)


def split_records(paths: Sequence[Path], held_out: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """Return the records for training and those for evaluation."""
    others = records_of(held_out)
    learnt = [record for record in records_of(paths) if record not in others]
    if not learnt:
        raise InputError(
            f"all training records are held out for evaluation ({len(others)} records): name "
            "others for training"
        )
    return learnt, others


# --- frames ---------------------------------------------------------------------------------------


def spaced(frames: Iterable[StoredFrame], every_s: float) -> Iterator[StoredFrame]:
    """Yield frames with a spacing of about `every_s`, without duplicates."""
    last: StoredFrame | None = None
    for frame in frames:
        if last is not None:
            passed_s = frame.note.captured_s - last.note.captured_s
            if frame.note.index <= last.note.index or passed_s < 0.75 * every_s:
                continue
        last = frame
        yield frame


def image_of(frame: StoredFrame, record: Path) -> NDArray[np.uint8]:
    """Decode a frame's image, (H, W, 3) RGB."""
    try:
        return frame.frame().image
    except InputError as error:
        raise FileError(record, f"frame {frame.note.index} is damaged: {error}") from error


def footage_of(path: Path) -> Flight:
    """Read a record's telemetry, and ten frames per second at the size of the depth network."""
    reader = flight_record(path)
    states: list[DroneState] = []

    def frames() -> Iterator[StoredFrame]:
        for item in footage(reader):
            if isinstance(item, StoredFrame):
                yield item
            elif isinstance(item, DroneState):
                states.append(item)

    shown = [
        frame.note.with_image(shrink(image_of(frame, path)))
        for frame in spaced(frames(), _FOOTAGE_EVERY_S)
    ]
    found = gathered(shown, states, reader.camera)
    if found is None:
        raise FileError(
            path, "the record lacks telemetry, or has no frame with an image to learn from"
        )
    return found


# --- depth ----------------------------------------------------------------------------------------


def read_flights(
    paths: Sequence[Path],
    segmenter: Segmenter | None,
    folder: Path,
    *,
    advance: Advance = silent,
) -> list[Flight]:
    """Read records and, with a segmenter, label them; existing labels are reused."""
    flights = []
    for done, path in enumerate(paths, start=1):
        flight = footage_of(path)
        if segmenter is not None:
            labels = _kept_labels(path, flight, segmenter, folder, advance)
            flight = replace(flight, labels=labels)
        flights.append(flight)
        advance("flights", done, len(paths))
    return flights


def _kept_labels(
    path: Path, flight: Flight, segmenter: Segmenter, folder: Path, advance: Advance
) -> NDArray[np.float16]:
    times_s = np.array([frame.captured_s for frame in flight.frames])
    about = zlib.crc32(times_s.tobytes() + flight.frames[-1].image.tobytes())
    file = folder / f"labels-{path.stem}-{about:08x}.npz"
    if file.is_file():
        return read_labels(file)

    def report(stage: str, done: int, total: int) -> None:
        advance(f"{stage}, {path.stem}", done, total)

    labels = contact_labels(flight, segmenter, advance=report)
    made = add_parallax(flight, labels, advance=report)
    folder.mkdir(parents=True, exist_ok=True)
    write_labels(file, made)
    return made


# --- advised views --------------------------------------------------------------------------------


def read_advised_flights(
    records: Sequence[Path],
    net: ControlNetConfig,
    folder: Path,
    *,
    advance: Advance = silent,
) -> list[ControlFlight]:
    """Read records of advised flights, with a cache."""
    flights: list[ControlFlight] = []
    camera: CameraModel | None = None
    for done, path in enumerate(records, start=1):
        reader = flight_record(path)
        camera = camera or reader.camera
        if reader.camera != camera:
            raise FileError(
                path,
                f"was flown with another camera than {records[0]} ({reader.camera} against "
                f"{camera}); train on the flights of one camera",
            )
        flights.append(_kept(reader, net, folder))
        advance("flights", done, len(records))
    return flights


def _kept(reader: RecordReader, net: ControlNetConfig, folder: Path) -> ControlFlight:
    size_px = (net.width_px, net.height_px)
    state = fingerprint(reader.path, dated=True)
    file = folder / f"{reader.path.stem}-{state}-{size_px[0]}x{size_px[1]}.npz"
    if file.is_file():
        return read_flight(file)
    made = _read(reader, size_px)
    write_flight(file, made)
    return made


def _read(reader: RecordReader, size_px: tuple[int, int]) -> ControlFlight:
    flight = advised_flight(_advised_views(reader, size_px))
    if flight is None:
        raise FileError(
            reader.path,
            "this flight contains no advice to learn from: fly "
            "explore_and_land_advised, or put <Advise/> into the tree",
        )
    return flight


def _advised_views(
    reader: RecordReader, size_px: tuple[int, int]
) -> Iterator[tuple[Image, Advice]]:
    advice = None
    for item in footage(reader):
        if isinstance(item, Advice):
            advice = item
        elif (
            isinstance(item, StoredFrame)
            and advice is not None
            and advice.frame_index == item.note.index
            and advice.answer.reason != _BLIND
        ):
            yield shrunk(image_of(item, reader.path), size_px), advice


def evaluate_student(
    flights: Sequence[ControlFlight], student: OnnxControlStudent, *, max_windows: int = 2000
) -> ControlScore:
    """Score an exported student on windows of advised flights, spread evenly over all."""

    def estimates(batch: Batch) -> list[ControlEstimate]:
        windows = zip(batch.frames, batch.state, strict=True)
        return [student.estimate(list(frames), state) for frames, state in windows]

    samples = ControlSamples(flights, student.config)
    return score_control(estimates, samples, max_windows=max_windows)
