"""Training of the control student: records of advised flights in, weights out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.control.ego_state import ControlNetConfig
from perception.control.runtime import ControlEstimate, OnnxControlStudent
from perception.control.training.samples import (
    Batch,
    ControlFlight,
    ControlSamples,
    FlightBuilder,
    read_flight,
    write_flight,
)
from perception.control.training.scoring import ControlScore, score_control
from perception.networks.onnx_runtime import shrunk
from uav_bt.errors import FileError, WeightsError
from uav_bt.learning.dataset import fingerprint, image_of
from uav_bt.learning.diary import Diary
from uav_bt.protocols import Advance, Advice, silent
from uav_bt.record.footage import flight_record, footage
from uav_bt.record.moment import StoredFrame
from uav_bt.record.reader import RecordReader
from uav_bt.types import CameraModel

CURVES: Final = ("loss", "missed", "stopped", "wrong_side", "step_error_m", "free_error_m")
"""What a run's diary draws."""

# The rule's reason when it saw nothing: that depends on the depth, not on the view.
_BLIND: Final = "no depth"


# --- records --------------------------------------------------------------------------------------


def read_advised_flights(
    records: Sequence[Path],
    net: ControlNetConfig,
    folder: Path,
    *,
    advance: Advance = silent,
) -> list[ControlFlight]:
    """Read records of advised flights; what was read before is kept in a folder.

    Args:
        records: the files.
        net: the network, for its size.
        folder: where the views are kept, small.
        advance: called after every record.

    Raises:
        FileError: a record is damaged, unfinished, of another camera, or nobody advised in it.
    """
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
    state = fingerprint(reader.path)
    file = folder / f"{reader.path.stem}-{state}-{size_px[0]}x{size_px[1]}.npz"
    if file.is_file():
        return read_flight(file)
    made = _read(reader, size_px)
    write_flight(file, made)
    return made


def _read(reader: RecordReader, size_px: tuple[int, int]) -> ControlFlight:
    builder, advice = FlightBuilder(size_px), None
    for item in footage(reader):
        if isinstance(item, Advice):
            advice = item
        elif (
            isinstance(item, StoredFrame)
            and advice is not None
            and advice.frame_index == item.note.index
            and advice.decision.reason != _BLIND
        ):
            builder.add(shrunk(image_of(item, reader.path), size_px), advice)
    if not len(builder):
        raise FileError(
            reader.path,
            "nobody advised in this flight, so there is nothing to learn from it: fly "
            "explore_and_land_advised, or put <Advise/> into the tree",
        )
    return builder.flight()


# --- training -------------------------------------------------------------------------------------


def first_weights(path: Path) -> Mapping[str, NDArray[np.float32]]:
    """Return weights to begin with: a control student's, or a segmentation U-Net's encoder.

    Raises:
        WeightsError: the file holds neither.
    """
    from perception.control.training.network import STUDENT_FILES  # noqa: PLC0415  (torch)
    from perception.segmentation.training.unet import UNET_FILES  # noqa: PLC0415  (torch)

    try:
        state = STUDENT_FILES.load(path)[0].state_dict()
    except WeightsError as no_student:
        try:
            unet, _ = UNET_FILES.load(path)
        except WeightsError:
            raise no_student from None
        state = {
            name: value for name, value in unet.state_dict().items() if name.startswith("down.")
        }
    return {name: value.numpy() for name, value in state.items()}


def train_student(
    flights: Sequence[ControlFlight],
    weights: Path,
    *,
    config: Any = None,
    net_config: ControlNetConfig | None = None,
    start: Path | None = None,
    checkpoint: Path | None = None,
    held_out: Sequence[ControlFlight] = (),
    validate_every: int = 500,
    diary: Diary | None = None,
    advance: Advance = silent,
) -> ControlScore | None:
    """Train the control student and write its safetensors and, beside them, the ONNX file.

    Args:
        flights: what to learn from.
        weights: the safetensors file; the ONNX file has the same name.
        config: a `perception.control.training.run.ControlTrainingConfig`; None for its defaults.
        net_config: the network's shape; None for its defaults.
        start: weights to begin with; None for random ones.
        checkpoint: the state of a run to go on from, and to keep.
        held_out: flights that are not learnt from, to measure on.
        validate_every: steps.
        diary: keeps losses, scores and curves.
        advance: called after every step, with the loss in the stage's name.

    Returns:
        The score at the end, None without flights to measure on.
    """
    from perception.control.training import network, run  # noqa: PLC0415  (torch: training only)
    from perception.networks.training.network_files import parameter_count  # noqa: PLC0415  (torch)

    settings = run.ControlTrainingConfig() if config is None else config
    shape = net_config or ControlNetConfig()
    samples = ControlSamples(flights, shape, settings.samples)
    others = ControlSamples(held_out, shape, settings.samples) if held_out else None
    losses: list[float] = []

    def score(net: Any) -> ControlScore | None:
        if others is None:
            return None
        return score_control(lambda batch: run.predict_control(net, batch), others)

    def follow(now: Any, net: Any) -> None:
        losses.append(now.loss)
        advance(f"training, loss {now.loss:.3f}", now.step, now.steps)
        if diary is not None and (now.step % validate_every == 0 or now.step == now.steps):
            scored = score(net)
            values = {} if scored is None else scored.to_json()
            diary.note(now.step, {"loss": float(np.mean(losses)), **values})
            losses.clear()

    net = run.train_control(
        samples,
        settings,
        shape,
        start=None if start is None else first_weights(start),
        checkpoint=checkpoint,
        progress=follow,
    )
    final = score(net)
    notes = {
        "training": asdict(settings),
        "start": None if start is None else start.name,
        "flights": len(flights),
        "windows": len(samples),
        "near_share": round(samples.near_share, 4),
        "parameters": parameter_count(net),
        "validation": None if final is None else final.to_json(),
    }
    network.STUDENT_FILES.save(weights, net, notes=notes)
    network.STUDENT_FILES.export(weights, weights.with_suffix(".onnx"))
    return final


def evaluate_student(
    flights: Sequence[ControlFlight], student: OnnxControlStudent, *, max_windows: int = 2000
) -> ControlScore:
    """Score a control student on advised flights.

    Args:
        flights: their views, of the network's size.
        student: the network as it flies.
        max_windows: how many are scored, evenly spread over all.

    Raises:
        ValueRangeError: no view can be scored.
        WeightsError: the network answered with something that is not a number.
    """

    def estimates(batch: Batch) -> list[ControlEstimate]:
        windows = zip(batch.frames, batch.state, strict=True)
        return [student.estimate(list(frames), state) for frames, state in windows]

    samples = ControlSamples(flights, student.config)
    return score_control(estimates, samples, max_windows=max_windows)
