"""Training data from flight records: frames, depth labels, advised views."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from perception.control.ego_state import ControlNetConfig
from perception.control.runtime import ControlEstimate, OnnxControlStudent
from perception.control.training import samples
from perception.control.training.samples import ControlFlight, ControlSamples, ControlScore
from perception.depth.training import labelling
from perception.depth.training.footage import Flight, gathered, shrink
from perception.networks.onnx_runtime import shrunk
from uav_bt.errors import FileError
from uav_bt.learning.lab_material import fingerprint
from uav_bt.protocols import Advance, Advice, Segmenter, silent
from uav_bt.record.moment import StoredFrame
from uav_bt.record.reader import RecordReader, flight_record, footage
from uav_bt.types import DroneState, Frame
from uav_bt.types.arrays import Image

_APART_S: Final = 0.075  # least time between frames, which come about every 0.1 s
# The rule's reason without depth, which depends on the depth network and not on the view.
_BLIND: Final = "no depth"


def records_of(paths: Sequence[Path]) -> list[Path]:
    """Return the records at paths: files, and all files below folders, each once."""
    found: dict[Path, None] = {}
    for path in paths:
        records = sorted(path.rglob("*.mcap")) if path.is_dir() else [path]
        if not records:
            raise FileError(path, "there is no flight record in this folder")
        found |= dict.fromkeys(records)
    return list(found)


def _image(frame: StoredFrame, reader: RecordReader) -> Image:
    """Return a frame's image, (H, W, 3) RGB; FileError if it is damaged."""
    with reader.intact(f"frame {frame.note.index}"):
        return frame.frame().image


def footage_of(path: Path) -> Flight:
    """Read a record's telemetry, and ten frames a second at the depth network's size."""
    reader = flight_record(path)
    states: list[DroneState] = []
    frames: list[Frame] = []
    for item in footage(reader):
        if isinstance(item, DroneState):
            states.append(item)
        elif isinstance(item, StoredFrame):
            last, note = (frames[-1] if frames else None), item.note
            if last is None or (
                note.index > last.index and note.captured_s - last.captured_s >= _APART_S
            ):
                frames.append(Frame(**vars(note), image=shrink(_image(item, reader))))
    found = gathered(frames, states, reader.camera)
    if found is None:
        raise FileError(
            path, "the record lacks telemetry, or has no frame with an image to learn from"
        )
    return found


def read_flights(
    paths: Sequence[Path], segmenter: Segmenter | None, folder: Path, *, advance: Advance = silent
) -> list[Flight]:
    """Read records and, with a segmenter, label them; labels in the folder are reused."""
    flights = []
    for done, path in enumerate(paths, start=1):
        flight = footage_of(path)
        if segmenter is not None:
            kept = folder / f"labels-{path.stem}-{fingerprint(path)}.npz"
            if not kept.is_file():
                labels = labelling.contact_labels(flight, segmenter, advance=advance)
                folder.mkdir(parents=True, exist_ok=True)
                parallax = labelling.add_parallax(flight, labels, advance=advance)
                labelling.write_labels(kept, parallax)
            flight = replace(flight, labels=labelling.read_labels(kept))
        flights.append(flight)
        advance("flights", done, len(paths))
    return flights


def read_advised_flights(
    records: Sequence[Path], net: ControlNetConfig, folder: Path, *, advance: Advance = silent
) -> list[ControlFlight]:
    """Read records of advised flights; views in the folder are reused."""
    flights: list[ControlFlight] = []
    camera = None
    size_px = (net.width_px, net.height_px)
    for done, path in enumerate(records, start=1):
        reader = flight_record(path)
        camera = camera or reader.camera
        if reader.camera != camera:
            raise FileError(
                path,
                f"was flown with another camera than {records[0]} ({reader.camera} against "
                f"{camera}); train on the flights of one camera",
            )
        kept = folder / f"{path.stem}-{fingerprint(path)}-{size_px[0]}x{size_px[1]}.npz"
        if not kept.is_file():
            flight = samples.advised_flight(_advised_views(reader, size_px))
            if flight is None:
                raise FileError(
                    path,
                    "this flight contains no advice to learn from: fly "
                    "explore_and_land_advised, or put <Advise/> into the tree",
                )
            samples.write_flight(kept, flight)
        flights.append(samples.read_flight(kept))
        advance("flights", done, len(records))
    return flights


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
            yield shrunk(_image(item, reader), size_px), advice


def evaluate_student(
    flights: Sequence[ControlFlight], student: OnnxControlStudent, *, max_windows: int = 2000
) -> ControlScore:
    """Score an exported student on windows of advised flights, spread evenly over all."""

    def estimates(batch: samples.Batch) -> list[ControlEstimate]:
        pairs = zip(batch.frames, batch.state, strict=True)
        return [student.estimate(list(frames), state) for frames, state in pairs]

    windows = ControlSamples(flights, student.config)
    return samples.score_control(estimates, windows, max_windows=max_windows)
